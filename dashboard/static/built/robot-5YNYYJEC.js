import{a}from"./chunk-4MH3I4Q4.js";import"./chunk-K52CK4ZW.js";import"./chunk-BAYTPQX6.js";export{a as Robot};
