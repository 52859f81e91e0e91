import{a}from"./chunk-TVYMANME.js";import"./chunk-3NDGFDJH.js";import"./chunk-BAYTPQX6.js";export{a as Robot};
