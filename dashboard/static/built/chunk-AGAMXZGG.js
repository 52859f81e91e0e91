function e(r,n,t=`${n}s`){return`${r.toLocaleString("en")} ${r===1?n:t}`}export{e as a};
