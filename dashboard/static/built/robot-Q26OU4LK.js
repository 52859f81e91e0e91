import{a}from"./chunk-YK5UT3CC.js";import"./chunk-CRRS6TBR.js";import"./chunk-BAYTPQX6.js";export{a as Robot};
