import{a}from"./chunk-JIBJR5ON.js";import"./chunk-XP7URV27.js";import"./chunk-BAYTPQX6.js";export{a as Robot};
