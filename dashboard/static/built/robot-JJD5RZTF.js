import{a}from"./chunk-TDXEQM56.js";import"./chunk-K52CK4ZW.js";import"./chunk-BAYTPQX6.js";export{a as Robot};
