import{a}from"./chunk-2P6JL7MX.js";import"./chunk-UIYWSF44.js";import"./chunk-BAYTPQX6.js";export{a as Robot};
