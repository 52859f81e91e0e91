import{a}from"./chunk-RV524YGL.js";import"./chunk-CF6VIUHV.js";import"./chunk-BAYTPQX6.js";export{a as Robot};
