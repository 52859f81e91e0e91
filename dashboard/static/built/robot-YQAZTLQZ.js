import{a}from"./chunk-SKBGOIOX.js";import"./chunk-EY2K3B6L.js";import"./chunk-BAYTPQX6.js";export{a as Robot};
