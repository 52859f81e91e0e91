import{a}from"./chunk-VMXJIM35.js";import"./chunk-43NWGC24.js";import"./chunk-BAYTPQX6.js";export{a as Robot};
