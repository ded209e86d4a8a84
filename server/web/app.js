/* joulecast operator page, built from source/; licences: third_party.txt */
import{A as e,B as t,C as a,D as n,E as s,F as l,G as o,H as r,I as i,J as d,K as u,L as c,M as h,N as $,O as m,P as p,Q as g,R as f,S as _,T as b,U as v,V as y,W as w,X as k,Y as x,Z as M,_ as j,a as T,aa as C,b as N,ba as S,c as P,ca as O,d as E,da as D,e as A,f as L,g as R,h as F,i as z,j as W,k as I,l as B,m as J,n as U,o as G,p as V,q,r as H,s as K,t as X,u as Y,v as Z,w as Q,x as ee,y as te}from"./base.js";var ae=class extends N{canvas=T();shouldComponentUpdate(e){return e.revision!==this.props.revision||e.dark!==this.props.dark||e.track!==this.props.track}componentDidMount(){this.draw()}componentDidUpdate(){this.draw()}draw(){let e=this.canvas.current,{width:t=128,height:a=30,track:n}=this.props,s=devicePixelRatio||1,l=e.getContext("2d"),o=i();e.width!==t*s&&(e.width=t*s,e.height=a*s),l.setTransform(s,0,0,s,0,0),l.clearRect(0,0,t,a),l.strokeStyle=o.graticule,l.lineWidth=1,l.beginPath();for(let e=t-.5;e>0;e-=32)l.moveTo(e,0),l.lineTo(e,a);let r=n.last(),d=1,u=0;for(let[,e,t]of r)e>d&&(d=e),t>d&&(d=t),e<u&&(u=e);let c=e=>a-2-(e-u)/(d-u)*(a-5);if(l.moveTo(0,Math.round(c(0))+.5),l.lineTo(t,Math.round(c(0))+.5),l.stroke(),r.length<2)return;let h=r[r.length-1][0];for(let[e,a,n]of[[2,o.modelled,1],[1,o.measured,1.5]]){l.strokeStyle=a,l.lineWidth=n,l.lineJoin="round",l.beginPath();let s=-1/0;for(let a of r){let n=t-2-(h-a[0])/9e7*t;Number.isFinite(a[e])&&(a[0]-s>5e6?l.moveTo(n,c(a[e])):l.lineTo(n,c(a[e])),s=a[0])}l.stroke()}}render(){let{width:e=128,height:t=30}=this.props;return Q`<canvas class="sparkline" ref=${this.canvas} style=${{width:`${e}px`,height:`${t}px`}} aria-hidden="true"></canvas>`}};function ne({live:e,band:t}){if(!t||null===t.p50)return Q`<${$} of=${G(e)} />`;let a=G(t.p05),n=G(t.p95);return Q`<${$} of=${G(t.p50)} /><span class="band"><span class="hidden">90 % between </span>${a.u===n.u?a.n:H(a)}–${H(n)}</span>`}var se=e=>(t,a)=>{let n=e(t.state),s=e(a.state);return(null==n)-(null==s)||(n<s?-1:n>s?1:0)},le=new Intl.Collator("en",{numeric:!0}),oe=[{key:"robot",title:"Robot",sort:(e,t)=>le.compare(e.id,t.id),class:"robot"},{key:"health",title:"Telemetry",sort:se(e=>e.live?0:null===e.silent_s?1/0:1+e.silent_s),class:"health"},{key:"power",title:"Power",sort:se(e=>e.measured_power_w??e.modelled_power_w),class:"figure power"},{key:"trace",title:"Last 90 s",class:"spark"},{key:"charge",title:"Charge",sort:se(e=>e.state_of_charge),class:"charge"},{key:"range",title:"Range",sort:se(e=>e.range_m),class:"figure"},{key:"time",title:"Run time",sort:se(e=>e.run_time_s),class:"figure wide"},{key:"speed",title:"Speed",sort:se(e=>e.speed_m_s),class:"figure wide"},{key:"mission",title:"Mission",sort:se(e=>e.mission?.start_utime_us),class:"mission"},{key:"spent",title:"Spent",sort:se(e=>e.mission?.energy.battery_j),class:"figure"}];function re({state:e}){let{level:t,text:a,faults:n}=function(e){let t=Object.values(e.faults).reduce((e,t)=>e+t,0);return e.has_model?e.live?{level:"good",text:"live",faults:t}:null===e.silent_s?{level:"none",text:"never heard",faults:t}:{level:"bad",text:`silent ${K(e.silent_s)}`,faults:t}:{level:"bad",text:"no model",faults:t}}(e),s=Object.entries(e.faults).map(([e,t])=>`${t} ${Z(e)}`).join(", ");return Q`<span class=${`lamp ${t}`} aria-hidden="true"></span>${a}
${n>0&&Q`<span class="note" title=${s}> · ${W(n)} faulty</span>`}`}function ie({share:e}){return null===e?Q`<span class="note">unknown</span>`:Q`<span class=${"charge-bar "+(e<.25?"low":"")} aria-hidden="true"><span style=${{width:`${Math.max(2,100*e)}%`}}></span></span>
<${$} of=${V(e)} />`}var de=class extends N{shouldComponentUpdate(e){return e.revision!==this.props.revision||e.entry!==this.props.entry||e.index!==this.props.index||e.dark!==this.props.dark||e.band!==this.props.band}render({entry:e,index:t,revision:a,dark:n,band:s}){let l=e.state,o=null===l.measured_power_w;return Q`<tr aria-rowindex=${t+2} class=${l.live?"":"quiet"}>
<th scope="row" class="robot"><a href=${u(e.id)}>${e.id}</a></th>
<td class="health"><${re} state=${l} /></td>
<td class="figure power"><${$} of=${U(l.measured_power_w??l.modelled_power_w)} />${o&&null!==l.modelled_power_w&&Q`<span class="note"> mod.</span>`}</td>
<td class="spark"><${ae} track=${e.power} revision=${a} dark=${n} /></td>
<td class="charge"><${ie} share=${l.state_of_charge} /></td>
<td class="figure"><${ne} live=${l.range_m} band=${s} /></td>
<td class="figure wide">${K(l.run_time_s)}</td>
<td class="figure wide"><${$} of=${q(l.speed_m_s,"m/s",2)} /></td>
<td class="mission">${l.mission?Q`<a href=${c(l.mission.id)}>${l.mission.mission_id}</a>`:Q`<span class="note">idle</span>`}</td>
<td class="figure"><${$} of=${J(l.mission?.energy.battery_j)} /></td>
</tr>`}};function ue({robots:e}){let[t,a,n,s,l,o]=[0,0,0,0,null,!1];for(let{state:r}of e.values()){let e=r.measured_power_w??r.modelled_power_w;r.live&&(a+=1,null!==e&&(t+=e,o=!0)),null!==r.mission&&(n+=1,s+=r.mission.energy.battery_j),null!==r.state_of_charge&&(null===l||r.state_of_charge<l.state_of_charge)&&(l=r)}return Q`<dl class="readouts">
<${m} large label="Fleet power" of=${o?U(t):{n:"–",u:""}} channel="measured" />
<${m} large label="Live" of=${`${a}`} note=${`of ${e.size}`} />
<${m} large label="On a mission" of=${`${n}`} />
<${m} large label="Spent in running missions" of=${J(s)} />
<${m} large label="Lowest charge" of=${V(l?.state_of_charge)} note=${l&&Q`<a href=${u(l.robot_id)}>${l.robot_id}</a>`} />
</dl>`}var ce=null,he=null;function $e({part:e,...t}){let[,a]=E(0),[n,s]=E(null),l=()=>a(e=>e+1),o=()=>{s(null),document.getElementById("gap-style")||document.head.append(Object.assign(document.createElement("link"),{id:"gap-style",rel:"stylesheet",href:"gap-style.css"})),(ce??=import("./gap.js").then(e=>{he=e},e=>{throw ce=null,e}),ce).then(l,()=>s({status:0,title:"This part of the page could not be loaded",message:"The service may be restarting, or the network is down."}))};if(A(()=>{null===he&&o()},[]),null!==n)return Q`<${f} error=${n} retry=${o} />`;if(null===he)return Q`<${g} what="this part of the page" />`;let r=he[e];return Q`<${r} ...${t} />`}var me={light:[[200,206,196],[226,178,92],[212,104,44],[150,38,48],[72,14,52]],dark:[[44,58,62],[104,72,104],[196,82,72],[250,152,56],[255,238,170]]},pe={light:[[20,84,140],[120,170,200],[196,196,190],[226,140,100],[172,36,34]],dark:[[70,170,255],[60,106,150],[78,84,84],[176,92,64],[255,120,84]]};function ge(e,t,a,n,s){return{scale:e,width:n,height:s,to:(l,o)=>[n/2+(l-t)*e,s/2-(o-a)*e],from:(l,o)=>[t+(l-n/2)/e,a-(o-s/2)/e]}}function fe(e){let t=10**Math.floor(Math.log10(e));return[5,2,1].map(e=>e*t).find(t=>t<=e)??t}function _e(e,t){let a=i(),n=fe(90/t.scale),[s,l]=t.from(0,0),[o,r]=t.from(t.width,t.height);e.strokeStyle=a.graticule,e.lineWidth=1,e.beginPath();for(let a=Math.ceil(s/n)*n;a<=o;a+=n){let n=Math.round(t.to(a,0)[0])+.5;e.moveTo(n,0),e.lineTo(n,t.height)}for(let a=Math.ceil(r/n)*n;a<=l;a+=n){let n=Math.round(t.to(0,a)[1])+.5;e.moveTo(0,n),e.lineTo(t.width,n)}e.stroke()}function be(e,t){let a=i(),n=fe(120/t.scale),s=n*t.scale,l=14.5,o=t.height-14.5;e.strokeStyle=e.fillStyle=a.ink,e.lineWidth=1.5,e.beginPath(),e.moveTo(l,o-5),e.lineTo(l,o),e.lineTo(l+s,o),e.lineTo(l+s,o-5),e.stroke(),e.font='12px "Liberation Sans", "Helvetica Neue", Arial, sans-serif',e.textAlign="left",e.textBaseline="alphabetic",e.fillText(`${I(n,1)} m`,l+s+6,o)}function ve(e,t,a,n,s,l){let[o,r]=t.to(a,n);e.save(),e.translate(o,r),e.rotate(-s),e.fillStyle=l,e.strokeStyle=i().screen,e.lineWidth=2,e.beginPath(),e.moveTo(11,0),e.lineTo(-7,7),e.lineTo(-3.5,0),e.lineTo(-7,-7),e.closePath(),e.stroke(),e.fill(),e.restore()}function ye({draw:e,height:t,label:a,changes:n,...s}){let l=R(null),o=R(e),i=r();o.current=e;let d=()=>{let e=l.current,a=devicePixelRatio||1,n=e?.clientWidth??0;if(0===n)return;(e.width!==Math.round(n*a)||e.height!==Math.round(t*a))&&(e.width=Math.round(n*a),e.height=Math.round(t*a));let s=e.getContext("2d");s.setTransform(a,0,0,a,0,0),s.clearRect(0,0,n,t),o.current(s,n,t)};return L(()=>{let e=new ResizeObserver(d);return e.observe(l.current),()=>e.disconnect()},[t]),A(d,[i,...n]),Q`<canvas class="floor" role="img" aria-label=${a} ref=${l} style=${{height:`${t}px`}} ...${s}></canvas>`}function we({points:e,kind:t="power",height:a=380,label:n,cursor:s=null,robot:o=null,legend:d=!0,ends:u=!0,under:c=null}){let h=e.filter(([e,t])=>Number.isFinite(e)&&Number.isFinite(t)),$=r(),m=function(e,t){let a=t.filter(Number.isFinite).map(t=>"gap"===e?Math.abs(t):t).sort((e,t)=>e-t),n=Math.max(a.length>0?a[Math.floor(.98*(a.length-1))]:1,.001),s=10**Math.floor(Math.log10(n))/2,o=Math.ceil(n/s)*s,r="gap"===e?-o:0,i=function(e){let t=[];for(let a=0;a<64;++a){let n=a/63*(e.length-1),s=Math.min(Math.floor(n),e.length-2),l=n-s,o=e[s].map((t,a)=>Math.round(t+(e[s+1][a]-t)*l));t.push(`rgb(${o.join(" ")})`)}return t}(("gap"===e?pe:me)[l()?"dark":"light"]);return{low:r,high:o,colours:i,colour_of:e=>i[Math.max(0,Math.min(63,Math.round((e-r)/(o-r)*63)))]}}(t,h.map(e=>e[2]));return Q`<div class="floor-box">
<${ye} draw=${(t,a,n)=>{let l=function(e,t,a,n=28,s=2){let[l,o,r,i]=[1/0,-1/0,1/0,-1/0];for(let[t,a]of e)!Number.isFinite(t)||!Number.isFinite(a)||(l=Math.min(l,t),o=Math.max(o,t),r=Math.min(r,a),i=Math.max(i,a));return l>o&&([l,o,r,i]=[-s,s,-s,s]),ge(Math.min((t-2*n)/Math.max(o-l,s),(a-2*n)/Math.max(i-r,s)),(l+o)/2,(r+i)/2,t,a)}([...h,...o?[o]:[],...c??[]],a,n,34);_e(t,l),null!==c&&function(e,t,a){e.strokeStyle=i().muted,e.lineWidth=1.25,e.setLineDash([5,4]),e.beginPath(),a.forEach(([a,n],s)=>e[0===s?"moveTo":"lineTo"](...t.to(a,n))),e.stroke(),e.setLineDash([])}(t,l,c),t.lineWidth=3.2,t.lineCap="round",t.lineJoin="round";let r=null;for(let e=1;e<h.length;++e){let a=h[e][2],n=Number.isFinite(a)?m.colour_of(a):i().line;n!==r&&(null!==r&&t.stroke(),t.strokeStyle=r=n,t.beginPath(),t.moveTo(...l.to(h[e-1][0],h[e-1][1]))),t.lineTo(...l.to(h[e][0],h[e][1]))}null!==r&&t.stroke(),h.length>1&&u&&function(e,t,a){let n=i(),s=a[0],l=a[a.length-1];e.lineWidth=2,e.strokeStyle=n.ink,e.fillStyle=n.screen;let[o,r]=t.to(s[0],s[1]);e.beginPath(),e.arc(o,r,5,0,7),e.fill(),e.stroke();let[d,u]=t.to(l[0],l[1]);e.fillStyle=n.ink,e.fillRect(d-4.5,u-4.5,9,9)}(t,l,h),o&&ve(t,l,o[0],o[1],o[2]??0,i().ink);let d=null===s?null:e[s];if(d&&Number.isFinite(d[0])){let[e,s]=l.to(d[0],d[1]);t.strokeStyle=i().ink,t.lineWidth=1,t.beginPath(),t.moveTo(e,0),t.lineTo(e,n),t.moveTo(0,s),t.lineTo(a,s),t.stroke(),t.fillStyle=i().accent,t.beginPath(),t.arc(e,s,6,0,7),t.fill(),t.stroke()}be(t,l)}} height=${a} label=${n} changes=${[e,t,s,o,c]} />
${d&&Q`<${ke} scale=${m} dark=${$} title=${"gap"===t?"measured − modelled":"power"} />`}
</div>`}function ke({scale:e,title:t,unit:a="W"}){let n=(e.low+e.high)/2;return Q`<div class="legend">
<span class="legend-title">${t}</span>
<span class="number">${I(e.low,2)}</span>
<${ye} draw=${(t,a,n)=>{let s=a/e.colours.length;e.colours.forEach((e,a)=>{t.fillStyle=e,t.fillRect(a*s,0,s+1,n)})}} height=${10} label=${`Colours from ${e.low} to ${e.high} ${a}`} changes=${[e.low,e.high,t]} />
<span class="number">${I(e.high,2)}${" "}${a}</span>
${"power"!==t&&Q`<span class="note">neutral at ${I(n,1)}</span>`}
</div>`}var xe={id:e=>e.id,robot_id:e=>e.robot_id,mission_id:e=>e.mission_id,state:e=>e.state,incomplete:e=>e.incomplete,incomplete_reason:e=>e.incomplete_reason,start_utime_us:e=>e.start_utime_us,end_utime_us:e=>e.end_utime_us,payload_kg:e=>e.payload_kg,model_version:e=>e.model_version,battery_j:e=>e.energy.battery_j,measured_j:e=>e.energy.measured_j,measured_s:e=>e.energy.measured_s,modelled_j:e=>e.energy.modelled_j,unexplained_j:e=>e.energy.unexplained_j,drawn_j:e=>e.energy.drawn_j,returned_j:e=>e.energy.returned_j,charge_ah:e=>e.energy.charge_ah,distance_m:e=>e.energy.distance_m,turned_rad:e=>e.energy.turned_rad,duration_s:e=>e.energy.duration_s,samples:e=>e.samples,gap_count:e=>e.gap_count,gap_s:e=>e.gap_s,note:e=>e.note},Me=e=>`${Object.values(xe).map(t=>function(e){if(null==e)return"";if("string"!=typeof e)return String(e);let t=/^[=+\-@\t\r]/.test(e)?`'${e}`:e;return/[",\r\n]/.test(t)?`"${t.replaceAll('"','""')}"`:t}(t(e))).join(",")}\r\n`,je=e=>e?1e3*new Date(e).getTime():void 0;function Te(e){return{robot_id:e.robot,mission_id:e.name,state:e.state,incomplete:e.incomplete,from_utime_us:je(e.from),to_utime_us:je(e.to),payload_min_kg:e.payload_min,payload_max_kg:e.payload_max}}var Ce=({measured_j:e,modelled_j:t})=>null!==e&&0!==t?e/t:null;function Ne({missions:e,with_robot:t=!0}){return Q`<table class="grid missions">
<thead><tr>
<th scope="col">Started</th>${t&&Q`<th scope="col">Robot</th>`}<th scope="col">Mission</th><th scope="col">State</th>
<th scope="col" class="figure">Duration</th><th scope="col" class="figure">Distance</th><th scope="col" class="figure wide">Payload</th>
<th scope="col" class="figure">Energy</th><th scope="col" class="figure wide">Modelled</th>
<th scope="col" class="figure"><abbr title="measured over modelled energy">Ratio</abbr></th><th scope="col" class="figure wide">Per metre</th>
</tr></thead>
<tbody>${e.map(e=>Q`<tr key=${e.id}>
<td class="when">${X(e.start_utime_us)}</td>
${t&&Q`<td><a href=${u(e.robot_id)}>${e.robot_id}</a></td>`}
<th scope="row"><a href=${c(e.id)}>${e.mission_id}</a></th>
<td><${w} mission=${e} />${e.incomplete&&Q` <span class="flag" title=${e.incomplete_reason??""}>incomplete</span>`}</td>
<td class="figure">${K(e.energy.duration_s)}</td>
<td class="figure"><${$} of=${G(e.energy.distance_m)} /></td>
<td class="figure wide"><${$} of=${q(e.payload_kg,"kg")} /></td>
<td class="figure"><${$} of=${J(e.energy.battery_j)} /></td>
<td class="figure wide"><${$} of=${J(e.energy.modelled_j)} /></td>
<td class="figure"><${Se} value=${Ce(e.energy)} /></td>
<td class="figure wide"><${$} of=${e.energy.distance_m>.1?q(e.energy.battery_j/e.energy.distance_m,"J/m"):q(null)} /></td>
</tr>`)}</tbody>
</table>`}function Se({value:e}){return Q`<span class=${z(e)&&Math.abs(e-1)>.1?"ratio off":"ratio"}>${W(e,3)}</span>`}function Pe({given:e,change:t}){let a=[...s().robots.keys()].sort(),n=a=>n=>t({...e,[a]:n.currentTarget.value}),l=(e,t)=>Q`<label class="field"><span>${e}</span>${t}</label>`,o=Object.values(e).some(e=>""!==e&&void 0!==e);return Q`<form class="filters" aria-label="Filter missions" onSubmit=${e=>e.preventDefault()}>
${l("Robot",Q`<select value=${e.robot??""} onChange=${n("robot")}><option value="">all</option>
${e.robot&&!a.includes(e.robot)&&Q`<option value=${e.robot}>${e.robot}</option>`}
${a.map(e=>Q`<option key=${e} value=${e}>${e}</option>`)}</select>`)}
${l("From",Q`<input type="datetime-local" value=${e.from??""} onChange=${n("from")} />`)}
${l("To",Q`<input type="datetime-local" value=${e.to??""} onChange=${n("to")} />`)}
${l("Payload from, kg",Q`<input class="short" type="number" min="0" step="any" value=${e.payload_min??""} onChange=${n("payload_min")} />`)}
${l("to, kg",Q`<input class="short" type="number" min="0" step="any" value=${e.payload_max??""} onChange=${n("payload_max")} />`)}
${l("State",Q`<select value=${e.state??""} onChange=${n("state")}><option value="">all</option>${y.map(e=>Q`<option key=${e} value=${e}>${e}</option>`)}</select>`)}
${l("Measured",Q`<select value=${e.incomplete??""} onChange=${n("incomplete")}><option value="">all</option><option value="false">complete</option><option value="true">incomplete</option></select>`)}
${l("Named",Q`<input type="text" value=${e.name??""} onChange=${n("name")} />`)}
<button type="button" class="plain" disabled=${!o} onClick=${()=>t({})}>Clear</button>
</form>`}function Oe({told:e}){return Q`<${_} of=${e} what="totals">${e=>{let t=e.energy,a=e.missions>0;return Q`<dl class="readouts">
<${m} label="Missions" of=${W(e.missions)} note=${e.incomplete_missions>0?`${W(e.incomplete_missions)} incomplete`:""} />
<${m} label="Energy from the batteries" of=${J(a?t.battery_j:null)} channel="measured" />
<${m} label="Modelled" of=${J(a?t.modelled_j:null)} channel="modelled" />
<${m} label="Unexplained" of=${J(t.unexplained_j)} channel="gap" note=${null!==t.unexplained_j&&0!==t.battery_j?`${W(100*t.unexplained_j/t.battery_j,1)} %`:""} />
<${m} label="Distance" of=${G(t.distance_m)} />
<${m} label="Per metre" of=${q(t.distance_m>0?t.battery_j/t.distance_m:null,"J/m")} />
<${m} label="Driving" of=${K(t.duration_s)} />
</dl>`}}<//>`}function Ee({given:t,total:a}){let[n,s]=E(null),[l,o]=E(null),r=R(null);A(()=>()=>r.current?.abort(),[]);let i=async a=>{r.current=new AbortController,o(null),s(0);try{await async function(t,a,n,s){let l,o=["csv"===t?`${Object.keys(xe).join(",")}\r\n`:"[\n"],r=0;do{let i=await ee(`/v1/missions${e({...a,limit:1e3,cursor:l})}`,s);i.missions.length>0&&("csv"===t?o.push(i.missions.map(Me).join("")):o.push((r>0?",\n":"")+i.missions.map(e=>JSON.stringify(e)).join(",\n"))),r+=i.missions.length,l=i.next_cursor,n(r)}while(null!==l);"json"===t&&o.push("\n]\n"),function(e,t,a){let n=URL.createObjectURL(new Blob(e,{type:a})),s=Object.assign(document.createElement("a"),{href:n,download:t});document.body.append(s),s.click(),s.remove(),setTimeout(()=>URL.revokeObjectURL(n),6e4)}(o,`joulecast-missions-${(new Date).toISOString().slice(0,19).replaceAll(":","")}.${t}`,"csv"===t?"text/csv":"application/json")}(a,Te(t),s,r.current.signal)}catch(e){"AbortError"!==e.name&&o(e)}s(null)};return null!==n?Q`<div class="export" role="status">
<progress max=${a||1} value=${n}></progress> ${W(n)} of ${W(a)}
<button type="button" onClick=${()=>r.current.abort()}>Stop</button></div>`:Q`<div class="export">${l&&Q`<span class="fault" role="alert">${l.message}</span>`}
<button type="button" disabled=${!a} onClick=${()=>i("csv")}>Export CSV</button>
<button type="button" disabled=${!a} onClick=${()=>i("json")}>Export JSON</button></div>`}function De({model:e}){return Q`<details class="model"><summary>Parameters in force</summary>
<table class="facts"><tbody>${Object.entries(D(e)).filter(([e])=>"robot_id"!==e).map(([e,t])=>Q`<tr key=${e}><th scope="row"><code>${e}</code></th><td>${t}</td></tr>`)}</tbody></table></details>`}function Ae({entry:e}){let t=e.state.mission?.id,n=a(t?`/v1/missions/${t}/trace?points=600`:null),[s]=E({mission:null,rows:[]});s.mission!==t&&Object.assign(s,{mission:t,rows:[]});let l=e.path.last(),o=[...t&&n.value&&n.value.id===t?n.value.x_m.map((e,t)=>[e??NaN,n.value.y_m[t]??NaN,n.value.measured_power_w.mean[t]??n.value.modelled_power_w.mean[t]??NaN]):[],...l.map(([e,t,,a])=>[e,t,a])],[r,i,d]=e.state.pose;return 0===o.length||null===r?Q`<${p} title="No position">This robot does not tell where it is.<//>`:Q`<${we} points=${o} height=${340} ends=${!1} robot=${[r,i,d??0]} label=${`Path of ${e.id} so far, coloured by power, and where it is now`} />`}function Le({rows:e,label:t}){let a=Math.max(...e.map(e=>e.value??0),1e-9);return Q`<table class="bars" aria-label=${t}><tbody>${e.map(e=>Q`<tr key=${e.name}>
<th scope="row">${e.name}</th>
<td class="bar-cell"><svg width="100%" height="18" aria-hidden="true" focusable="false"><rect class=${`account ${e.channel}`} x="0" y="3" height="12" width=${100*Math.max(0,e.value??0)/a+"%"} /></svg></td>
<td class="figure"><${$} of=${e.of} /></td>
<td class="note">${e.note}</td></tr>`)}</tbody></table>`}var Re={accessories:"Idle and accessories",driver:"Motor drivers",copper:"Copper",brush:"Brushes",friction_internal:"Friction in motors and gears",friction_rolling:"Rolling",friction_scrub:"Scrub in turns",friction_zone:"Floor zones",friction_slip:"Wheel slip",drag:"Air",kinetic:"Change of motion",potential:"Change of height",braking:"Generated in braking",recovered:"Recovered",sensor:"Sensor fault",unexplained:"Unexplained"};function Fe({terms_j:e,battery_j:t,closure:a,measured:n=!0}){let{rows:s,sum:l,absent:o}=function(e,t){let a=e=>Math.abs(e)<=1e-5*Math.abs(t),n=[],s=0;for(let[t,l]of Object.entries(e)){let e="recovered"===t?-l:l;"unexplained"===t&&n.push({key:"modelled",name:"Modelled",from:0,to:s,total:!0}),a(l)&&"unexplained"!==t||n.push({key:t,name:Re[t]??Z(t),from:s,to:s+e,change:e}),s+=e}return{rows:n,sum:s,absent:Object.entries(e).filter(([e,t])=>a(t)&&"unexplained"!==e).map(([e])=>(Re[e]??e).toLowerCase())}}(e,t),r=n?s:s.filter(e=>"unexplained"!==e.key&&"modelled"!==e.key),i=r.flatMap(e=>[e.from,e.to]).concat(t,0),d=Math.min(...i),u=Math.max(...i),c=Math.max(u-d,1e-9),h=e=>(e-d)/c*100,m=[...r,{key:"battery",name:n?"From the battery":"Total",from:0,to:t,total:!0}];return Q`<div class="waterfall">
<svg class="patterns" width="0" height="0" aria-hidden="true" focusable="false"><defs><pattern id="hatch" width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)"><rect class="hatch-back" width="6" height="6" /><line class="hatch-line" x1="0" x2="0" y1="0" y2="6" /></pattern></defs></svg>
<table>
<thead class="hidden"><tr><th scope="col">Account</th><th scope="col">Bar</th><th scope="col">Energy</th><th scope="col">Share</th></tr></thead>
<tbody>
${m.map(e=>{let a=e.total?e.to:e.change;return Q`<tr key=${e.key} class=${e.total?`total ${e.key}`:"unexplained"===e.key?"odd":""}>
<th scope="row">${e.name}</th>
<td class="bar-cell">${(e=>{let a=Math.min(h(e.from),h(e.to)),n=Math.abs(h(e.to)-h(e.from));return Q`<svg class="bar" width="100%" height=${30} aria-hidden="true" focusable="false">
<line class="zero" x1=${`${h(0)}%`} x2=${`${h(0)}%`} y1="0" y2=${30} />
<line class="goal" x1=${`${h(t)}%`} x2=${`${h(t)}%`} y1="0" y2=${30} />
${"battery"!==e.key&&Q`<line class="step" x1=${`${h(e.to)}%`} x2=${`${h(e.to)}%`} y1=${23} y2=${30} />`}
<rect class=${`account ${e.total?e.key:"unexplained"===e.key?"unexplained":e.change<0?"back":"out"}`}
x=${`${a}%`} y="7" width=${`${Math.max(n,.15)}%`} height=${16} />
</svg>`})(e)}</td>
<td class="figure"><${$} of=${J(a)} sign=${!e.total} /></td>
<td class="figure share">${0!==t?W(100*a/t,1):"–"}${" "}%</td>
</tr>`})}
</tbody>
</table>
<p class="closing">
Accounts add up to <b>${W(l,2)}${" "}J</b>; the battery gave <b>${W(t,2)}${" "}J</b>.
${void 0!==a&&Q` ${a<1e-9?"Closes":"Does not close"}: difference ${0===a?"none":a.toExponential(1)} of the whole.`}
${o.length>0&&Q` <span class="note">Next to nothing in: ${o.join(", ")}.</span>`}
</p>
</div>`}var ze=(e,t)=>t.map(e=>{if(null===e)return"";let t=e<0?"−":"",a=Math.abs(e);return`${t}${Math.floor(a/60)}:${String(Math.floor(a%60)).padStart(2,"0")}`});function We({trace:e,mission:t,zoom:a,set_zoom:n,set_cursor:s}){let[l,o]=F(()=>{let a=(...a)=>function(e,t,a){let n=function(e,t){return e.start_utime_us.map(a=>(a-t+e.width_us/2)/1e6)}(e,t),s=[];for(let t=1;t<n.length;++t)e.start_utime_us[t]-e.start_utime_us[t-1]>1.9*e.width_us&&s.push(t);if(0===s.length)return[n,...a];let l=(e,t)=>{let a=[];return e.forEach((n,l)=>{s.includes(l)&&a.push(void 0===t?(e[l-1]+n)/2:t),a.push(n)}),a};return[l(n),...a.map(e=>l(e,null))]}(e,t.start_utime_us,a.flatMap(e=>[e.max,e.min,e.mean]));return[a(e.measured_power_w,e.modelled_power_w),a(e.speed_m_s)]},[e]),r=R(e);r.current=e;let d={setCursor:[e=>s(null===e.cursor.idx||void 0===e.cursor.idx?null:Be(r.current,t.start_utime_us+1e6*e.data[0][e.cursor.idx]))],setSelect:[e=>{e.select.width<6||(n([e.posToVal(e.select.left,"x"),e.posToVal(e.select.left+e.select.width,"x")]),e.setSelect({left:0,top:0,width:0,height:0},!1))}]},u={...O("mission"),drag:{x:!0,y:!1,setScale:!1,dist:6},bind:{dblclick:()=>()=>n(null)}},c=e=>j(e,{size:26,values:ze});return Q`
<${C} make=${()=>{let e=i(),t={show:!0,stroke:"transparent",points:{show:!1}};return{cursor:u,hooks:d,scales:{x:{time:!1}},axes:[c(""),j("power, W")],bands:[{series:[1,2],fill:S(e.measured,.2)},{series:[4,5],fill:S(e.modelled,.16)}],series:[{},t,t,{stroke:e.measured,width:1.75,points:{show:!1}},t,t,{stroke:e.modelled,width:1.5,points:{show:!1}}]}}} data=${l} height=${270} changes=${[t.id]} label="Battery power over the mission, measured and modelled, with the least and greatest of each span" />
<${C} make=${()=>{let e=i(),t={stroke:"transparent",points:{show:!1}};return{cursor:u,hooks:d,scales:{x:{time:!1}},axes:[c("time since the start, min:s"),j("speed, m/s")],bands:[{series:[1,2],fill:S(e.ink,.12)}],series:[{},t,t,{stroke:e.ink,width:1.5,points:{show:!1}}]}}} data=${o} height=${150} changes=${[t.id]} label="Speed over the mission" />`}function Ie({trace:e,mission:t,index:a}){let n=null!==a&&a<e.start_utime_us.length?a:null,s=(e,t)=>null===n?{n:"–",u:""}:t(e[n]),l=e.measured_power_w,o=e.modelled_power_w,r=null===n||null===l.mean[n]?null:l.mean[n]-o.mean[n];return Q`<dl class="readouts strip" aria-live="off">
<${m} label="Time" of=${null===n?"–":K((e.start_utime_us[n]-t.start_utime_us)/1e6)} />
<${m} label="Measured" channel="measured" of=${s(l.mean,U)} note=${null!==n&&null!==l.mean[n]?`${W(l.min[n],0)} to ${W(l.max[n],0)}`:""} />
<${m} label="Modelled" channel="modelled" of=${s(o.mean,U)} />
<${m} label="Gap" channel="gap" of=${(()=>{let e=U(r);return{n:B(e.n),u:e.u}})()} />
<${m} label="Speed" of=${s(e.speed_m_s.mean,e=>q(e,"m/s",2))} />
<${m} label="Charge" of=${s(e.state_of_charge,e=>V(e,2))} />
</dl>`}function Be(e,t){let a=Math.floor((t-e.start_utime_us[0])/e.width_us),n=Math.max(0,Math.min(a,e.start_utime_us.length-1));for(;n>0&&e.start_utime_us[n]>t;)n-=1;return n}function Je({mission:t,whole:n,fine:s}){let[l,o]=E(null),[r,i]=E(null),[d,u]=E("power"),c=e=>Math.round(t.start_utime_us+1e6*e),h=a(null===l?null:`/v1/missions/${t.id}/trace${e({points:700,from_utime_us:c(l[0]),to_utime_us:c(l[1])})}`),$=null!==l&&null!==h.value&&h.value.start_utime_us.length>1?h.value:n,m=n.measured_power_w.mean.some(e=>null!==e),g=$===n?s:$,f=F(()=>g.x_m.map((e,t)=>{let a=g.measured_power_w.mean[t],n=g.modelled_power_w.mean[t];return[e??NaN,g.y_m[t]??NaN,"gap"===d?null===a?NaN:a-n:a??n??NaN]}),[g,d]),_=null===r||r>=$.start_utime_us.length?null:Be(g,$.start_utime_us[r]+$.width_us/2),y=f.some(([e])=>Number.isFinite(e));return 0===n.start_utime_us.length?Q`<${b} title="Power"><${p} title="No trace kept">The mission ended before its first sample was stored.<//><//>`:Q`<div class="columns trace-columns">
<${b} class="screen" title="Power and speed" aside=${Q`
<span class="key"><span class="swatch measured"></span>measured <span class="swatch modelled"></span>modelled <span class="swatch band"></span>least to greatest</span>
${null===l?Q`<span class="note">drag to look closer</span>`:Q`<button type="button" onClick=${()=>o(null)}>Whole mission</button>`}`}>
<${We} trace=${$} mission=${t} zoom=${l} set_zoom=${o} set_cursor=${i} />
<${Ie} trace=${$} mission=${t} index=${r} />
<p class="note foot">Each point is ${K($.width_us/1e6)}${null!==l?", closer view":""}.</p>
<//>
<${b} class="screen" title="On the floor" aside=${Q`<${v} label="Colour by" value=${d} onChange=${u} options=${m?[["power","Power"],["gap","Gap"]]:[["power","Power"]]} />`}>
${y?Q`<${we} points=${f} kind=${d} cursor=${_} height=${440} label=${`Path of the mission, coloured by ${"gap"===d?"measured minus modelled power":"power"}; circle: start, square: end`} />
<p class="note foot">○ start  ■ end. Poses as the robot told them.</p>`:Q`<${p} title="No poses">This robot did not tell where it was.<//>`}
<//>
</div>`}function Ue({mission:e,trace:n}){let s=a(`/v1/robots/${t(e.robot_id)}`),l=s.value?.model.idle_power_w,o=F(()=>void 0===l?null:function(e,t,a){let{distance_m:n,duration_s:s}=e.energy,{runs:l,stood_at_end_s:o}=function(e,t){let a=[],n=null,s=null,l=0;return e.speed_m_s.mean.forEach((o,r)=>{let i=Math.abs(o??0),[d,u]=[e.x_m[r],e.y_m[r]],c=e.covered_s[r]??0;if(i<=.02?(n=null,e.modelled_power_w.mean[r]<=1.05*t&&(l+=c)):(null===n&&(a.push(n={length_m:0,stood_s:l,first:NaN,last:NaN}),l=0),n.length_m+=i*c),null===d||null===u||(null===s&&(s=[d,u]),Math.hypot(d-s[0],u-s[1])<.05))return;let h=Math.atan2(u-s[1],d-s[0]),$=n??a[a.length-1];void 0!==$&&(Number.isNaN($.first)&&($.first=h),$.last=h),s=[d,u]}),{runs:a.filter(({length_m:e})=>e>=.05),stood_at_end_s:l}}(t,a);if(0===l.length||l.length>400||n<.05)return null;let r=l.reduce((e,t)=>e+t.length_m,0),i=e=>e>.2?[{kind:"dwell",duration_s:e}]:[];return{path:[...l.flatMap((e,t)=>{let a=0===t?NaN:function(e,t){let a=t-e;return Math.atan2(Math.sin(a),Math.cos(a))}(l[t-1].last,e.first);return[...i(e.stood_s),...Math.abs(a)>.02?[{kind:"turn",angle_rad:a}]:[],{kind:"straight",length_m:e.length_m/r*n}]}),...i(o)],payload_kg:e.payload_kg??0,deadline_s:s,columns:!1}}(e,n,l),[e.id,e.state,l]),[r,i]=E({value:null,error:null});A(()=>{if(null===o)return;let a=new AbortController;return te(`/v1/robots/${t(e.robot_id)}/profile`,o,a.signal).then(e=>i({value:e,error:null}),e=>"AbortError"===e.name||i({value:null,error:e})),()=>a.abort()},[o]);let d=null===s.value?s.error:r.error;if(null!==d)return Q`<${f} error=${d} />`;if(null!==s.value&&null===o)return Q`<${p} title="Nothing to compare">The robot did not drive, or in too many short runs.<//>`;if(null===r.value)return Q`<${g} what="the minimum-energy drive" />`;let u=e.energy,c=r.value,h=1-c.energy_j/u.modelled_j,$=o.path.reduce((e,t)=>e+Math.abs(t.angle_rad??0),0),m=o.path.reduce((e,t)=>e+(t.duration_s??0),0),_=o.path.filter(e=>"straight"===e.kind).length;return Q`
<p class="verdict">${h>.005?Q`The same legs could have been driven for <b>${W(100*h,1)}${" "}%</b> less.`:h>-.005?"Driven about as cheaply as the model allows.":"Driven for less than these legs cost from stop to stop: the robot turned while it drove."}</p>
<${Le} label="Energy of the mission and of the minimum-energy drive" rows=${[{name:"Measured",value:u.measured_j,of:J(u.measured_j),channel:"measured",note:K(u.duration_s)},{name:"Modelled",value:u.modelled_j,of:J(u.modelled_j),channel:"modelled",note:K(u.duration_s)},{name:"Least energy",value:c.energy_j,of:J(c.energy_j),channel:"least",note:K(c.duration_s)}]} />
<p class="note foot">${_} ${1===_?"leg":"legs"} between stops, ${H(G(u.distance_m))} in all, ${W(180*$/Math.PI)}° turned at the stops,${m>0?` ${K(m)} standing as the mission did,`:""}${" "}payload ${H(q(e.payload_kg??0,"kg"))}, arriving no later. Model version ${c.model_version}; the saving is against the modelled energy, so that a gap of the model does not count as one.</p>`}function Ge({mission:e}){let t=Object.entries(e.sample_faults),a=(e,t)=>Q`<tr><th scope="row">${e}</th><td>${t}</td></tr>`,n=e.energy;return Q`<table class="facts"><tbody>
${a("Robot",Q`<a href=${u(e.robot_id)}>${e.robot_id}</a>`)}
${a("Started",X(e.start_utime_us))}
${a("open"===e.state?"Last heard":"Ended",X(e.end_utime_us))}
${a("Announced",e.implicit?"no: opened by its telemetry":"by the robot")}
${a("Model",null===e.model_version?"none":`version ${e.model_version}`)}
${a("Samples",W(e.samples))}
${a("Gaps",0===e.gap_count?"none":`${e.gap_count}, ${K(e.gap_s)} in all`)}
${a("Faulty samples",0===t.length?"none":t.map(([e,t])=>`${t} ${Z(e)}`).join(", "))}
${a("Battery measured",`${K(n.measured_s)} of ${K(n.duration_s)}`)}
${a("Drawn · returned",`${H(J(n.drawn_j))} · ${H(J(n.returned_j))}`)}
${a("Charge",H(q(1e3*n.charge_ah,"mAh")))}
${a("Motors measured",null===n.measured_motor_j[0]?"–":`right ${H(J(n.measured_motor_j[0]))}, left ${H(J(n.measured_motor_j[1]))}`)}
${a("Motors modelled",`right ${H(J(n.modelled_motor_j[0]))}, left ${H(J(n.modelled_motor_j[1]))}`)}
${e.note&&a("Note",e.note)}
</tbody></table>`}var Ve=Math.PI/180,qe={straight:{name:"Straight",fields:{length:{label:"length",unit:"m",min:.01,start:5}}},turn:{name:"Turn in place",fields:{angle:{label:"angle, left positive",unit:"°",start:90}}},arc:{name:"Arc",fields:{radius:{label:"radius",unit:"m",min:.01,start:2},angle:{label:"angle, left positive",unit:"°",start:90}}},dwell:{name:"Dwell",fields:{duration:{label:"time",unit:"s",min:0,start:10}}},payload:{name:"Payload from here",fields:{mass:{label:"payload",unit:"kg",min:0,start:10}}}};function He(e){return{kind:e,...Object.fromEntries(Object.entries(qe[e].fields).map(([e,t])=>[e,t.start]))}}function Ke(e){switch(e.kind){case"turn":return{kind:"turn",angle_rad:e.angle*Ve};case"arc":return{kind:"arc",radius_m:e.radius,angle_rad:e.angle*Ve};case"dwell":return{kind:"dwell",duration_s:e.duration};case"payload":return{kind:"payload",payload_kg:e.mass};default:return{kind:"straight",length_m:e.length}}}function Xe(e){let[[t,a],n]=e;return{start_pose:{x_m:t,y_m:a,heading_rad:Math.atan2(n[1]-a,n[0]-t)},path:[{kind:"polyline",points:e.slice(1).map(([e,t])=>({x_m:e,y_m:t}))}]}}var Ye=.25,Ze=e=>Math.round(e/Ye)*Ye;function Qe({points:e,change:t,height:a=400}){let[n,s]=E(16),[l,o]=E(null),r=R(null),d=R(null),u=e=>{let t=e.currentTarget.getBoundingClientRect();return[e.clientX-t.left,e.clientY-t.top]},c=e=>d.current.from(...e).map(Ze),h=a=>{let n=e[e.length-1];(!n||n[0]!==a[0]||n[1]!==a[1])&&t([...e,a])},$=()=>{r.current=null};return Q`<div class="draw">
<${ye} draw=${(t,a,s)=>{let o=d.current=ge(a/n,0,0,a,s),r=i();if(_e(t,o),t.strokeStyle=t.fillStyle=r.accent,t.lineWidth=3,t.lineJoin="round",t.beginPath(),e.forEach(([e,a],n)=>t[0===n?"moveTo":"lineTo"](...o.to(e,a))),t.stroke(),e.forEach(([a,n],s)=>{t.beginPath(),t.arc(...o.to(a,n),5,0,7),t.fillStyle=s===e.length-1?r.accent:r.screen,t.fill(),t.stroke()}),e.length>0&&ve(t,o,e[0][0],e[0][1],e.length>1?Math.atan2(e[1][1]-e[0][1],e[1][0]-e[0][0]):0,r.ink),l){let[e,a]=o.to(...l);t.strokeStyle=r.ink,t.lineWidth=1,t.beginPath(),t.moveTo(e-12,a),t.lineTo(e+12,a),t.moveTo(e,a-12),t.lineTo(e,a+12),t.stroke()}be(t,o)}} height=${a} changes=${[e,n,l]} role="application" tabindex="0"
label=${`Drawing of the path, ${e.length} points. Arrow keys move the cross, Enter adds a point, Backspace removes the last.${l?` Cross at ${I(l[0],3)}, ${I(l[1],3)} metres.`:""}`}
onPointerDown=${t=>{let a=u(t),n=(([t,a])=>e.findIndex(([e,n])=>{let[s,l]=d.current.to(e,n);return Math.hypot(t-s,a-l)<12}))(a);t.currentTarget.setPointerCapture(t.pointerId),n>=0?r.current=n:(h(c(a)),r.current=e.length)}} onPointerMove=${a=>{if(null===r.current)return;let n=c(u(a)),s=e[r.current];s&&(s[0]!==n[0]||s[1]!==n[1])&&t(e.map((e,t)=>t===r.current?n:e))}} onPointerUp=${$} onPointerCancel=${$} onKeyDown=${a=>{let n=a.shiftKey?1:Ye,s={ArrowLeft:[-n,0],ArrowRight:[n,0],ArrowUp:[0,n],ArrowDown:[0,-n]}[a.key],r=l??e[e.length-1]??[0,0];if(s)o([r[0]+s[0],r[1]+s[1]]);else if("Enter"===a.key)h(r);else{if("Backspace"!==a.key&&"Delete"!==a.key)return;t(e.slice(0,-1))}a.preventDefault()}} />
<div class="tools"><button type="button" onClick=${()=>t(e.slice(0,-1))} disabled=${0===e.length}>Undo point</button>
<button type="button" onClick=${()=>t([])} disabled=${0===e.length}>Clear</button>
<button type="button" onClick=${()=>s(n/2)} disabled=${n<=4} aria-label="Closer">+</button>
<button type="button" onClick=${()=>s(2*n)} disabled=${n>=256} aria-label="Wider">−</button>
<span class="note">Press to add, drag to move; snaps to ${Ye} m. Corners are turned in place.</span></div>
</div>`}var et=()=>[{kind:"straight",length:6},{kind:"turn",angle:90},{kind:"straight",length:4}];function tt({legs:e,change:t,fault:a}){let n=(a,n)=>{let s=[...e];[s[a],s[a+n]]=[s[a+n],s[a]],t(s)};return Q`<fieldset class="legs"><legend>Legs</legend><ol>
${e.map((s,l)=>Q`<li key=${l} class=${a===l?"faulty":""}>
<select aria-label=${`Kind of leg ${l+1}`} value=${s.kind} onChange=${a=>t(e.map((e,t)=>t===l?He(a.currentTarget.value):e))}>
${Object.entries(qe).map(([e,{name:t}])=>Q`<option key=${e} value=${e}>${t}</option>`)}</select>
<span class="leg-fields">${Object.entries(qe[s.kind].fields).map(([a,n])=>Q`<label key=${a} class="inline"><span class="hidden">${`Leg ${l+1}, ${n.label}`}</span>
<input type="number" step="any" min=${n.min} required title=${n.label} value=${s[a]} onInput=${n=>((a,n)=>t(e.map((e,t)=>t===a?{...e,...n}:e)))(l,{[a]:n.currentTarget.valueAsNumber})} /><span class="unit">${n.unit}</span></label>`)}</span>
<span class="leg-tools"><button type="button" class="plain" disabled=${0===l} aria-label=${`Move leg ${l+1} up`} onClick=${()=>n(l,-1)}>↑</button>
<button type="button" class="plain" disabled=${l===e.length-1} aria-label=${`Move leg ${l+1} down`} onClick=${()=>n(l,1)}>↓</button>
<button type="button" class="plain" disabled=${1===e.length} aria-label=${`Remove leg ${l+1}`} onClick=${()=>t(e.filter((e,t)=>t!==l))}>×</button></span></li>`)}
</ol><button type="button" onClick=${()=>t([...e,He("straight")])}>Add a leg</button></fieldset>`}function at(e,t,a,n){return e.map(e=>a*Math.max(0,Math.min(1,e/(n*t),(t-e)/(n*t))))}function nt({answer:e,straight:t}){let a=e.profile,n=a.yaw_rate_rad_s.some(e=>Math.abs(e)>1e-6),{trapezoid:s,triangle:l}=e.baselines,o=F(()=>[a.time_s,a.speed_m_s,t&&s?at(a.time_s,s.duration_s,s.peak_speed_m_s,1/3):a.time_s.map(()=>null),t&&l?at(a.time_s,l.duration_s,l.peak_speed_m_s,.5):a.time_s.map(()=>null),n?a.yaw_rate_rad_s:a.time_s.map(()=>null)],[e]),r=F(()=>[a.time_s,a.power_w],[e]),d={sync:{key:"plan"},drag:{x:!1,y:!1}};return Q`
<${C} make=${()=>{let e=i(),t={show:!1};return{cursor:d,scales:{x:{time:!1},yaw:{}},axes:[j("",{size:26}),j("speed, m/s"),...n?[j("yaw rate, rad/s",{scale:"yaw",side:1,grid:{show:!1}})]:[]],series:[{},{stroke:e.accent,width:2.25,points:t},{stroke:e.muted,width:1.25,dash:[6,4],points:t},{stroke:e.muted,width:1.25,dash:[2,3],points:t},{stroke:e.modelled,width:1.25,scale:n?"yaw":"y",points:t}]}}} data=${o} height=${210} changes=${[n,t]} label=${`Speed over ${K(e.duration_s)}, greatest ${W(e.peak_speed_m_s,2)} metres a second`} />
<${C} make=${()=>{let e=i();return{cursor:d,scales:{x:{time:!1}},axes:[j("time, s",{size:26}),j("power, W"),...n?[j(" ",{scale:"y",side:1,grid:{show:!1},ticks:{show:!1},values:()=>[]})]:[]],series:[{},{stroke:e.accent,width:1.75,fill:S(e.accent,.12),points:{show:!1}}]}}} data=${r} height=${150} changes=${[n]} label="Battery power of the optimal profile over time" />
<p class="note foot"><span class="swatch accent"></span>least energy ${n&&Q`<span class="swatch modelled"></span>yaw rate `}${t&&Q`<span class="swatch dashed"></span>trapezoid <span class="swatch dotted"></span>triangle`}</p>`}function st({answer:e,take:t}){let a=e.pareto,{trapezoid:n,triangle:s}=e.baselines,l=F(()=>M.join([[a.map(e=>e.duration_s),a.map(e=>e.energy_j)],[[e.duration_s],[e.energy_j]],n?[[n.duration_s],[n.energy_j]]:[[],[]],s?[[s.duration_s],[s.energy_j]]:[[],[]]]),[e]),[o,r]=E(0),d=a[Math.min(o,a.length-1)];return Q`<${C} make=${()=>{let e=i(),t=(e,t,a)=>({stroke:"transparent",paths:()=>null,points:{show:!0,size:t,width:2,stroke:e,fill:a}});return{scales:{x:{time:!1}},cursor:{y:!1,drag:{x:!1,y:!1},points:{show:!1}},axes:[j("duration, s",{size:26}),j("energy, J",{size:58})],series:[{},{stroke:e.modelled,width:1.5,spanGaps:!0,points:{show:!0,size:5,fill:e.modelled}},t(e.accent,12,e.accent),t(e.muted,9,e.screen),t(e.muted,9,e.muted)]}}} data=${l} height=${230} changes=${[]} label=${`Energy against duration, from ${K(a[0].duration_s)} to ${K(a[a.length-1].duration_s)}`} />
<p class="note foot"><span class="swatch accent dot"></span>this plan <span class="swatch hollow dot grey"></span>trapezoid <span class="swatch grey dot"></span>triangle <span class="swatch modelled"></span>front</p>
<div class="front-pick"><label><span>Walk the front</span><input type="range" min="0" max=${a.length-1} value=${o} onInput=${e=>r(e.currentTarget.valueAsNumber)} aria-valuetext=${`${K(d.duration_s)}, ${H(J(d.energy_j))}`} /></label>
<span class="number">${W(d.duration_s,1)} s · ${H(J(d.energy_j))}; a second less costs ${H(J(d.time_multiplier_w))}</span>
<button type="button" onClick=${()=>t(d)}>Take as deadline</button></div>`}function lt({answer:e}){let t=e.certificate,a=(e,t)=>Q`<tr><th scope="row">${e}</th><td>${t}</td></tr>`;return Q`<table class="facts"><tbody>
${a("Found by",Z(t.method))}
${a("Above the lower bound by",Q`at most ${H(J(t.gap_j))}`)}
${a("Discretisation",H(J(t.discretisation_j)))}
${a("A global optimum",t.convex?"yes: the problem is convex":"not proven: the problem is not convex")}
${a("A second less costs",H(J(t.time_multiplier_w)))}
${a("Limits met",0===t.binding.length?"none":t.binding.map(Z).join(", "))}
${a("Braking",`${H(J(e.braking_j))}, of which ${H(J(e.recovered_j))} returns`)}
${a("Peak power",H(U(e.peak_power_w)))}
${a("Model",`version ${e.model_version}`)}
</tbody></table>`}function ot({answer:e,autonomy:t}){if(null!==t.error)return Q`<${f} error=${t.error} />`;if(null===t.value)return Q`<p class="verdict open">The robot has not told its charge: enter it to see whether the robot makes it.</p>`;let a=t.value,n=a.usable_energy_j-e.energy_j,s=n>=0,l=a.state_of_charge-a.reserve_fraction,o=l>0?a.state_of_charge-l*e.energy_j/a.usable_energy_j:null,r=e.energy_j>0?Math.floor(a.usable_energy_j/e.energy_j):null;return Q`<div class=${"verdict-box "+(s?"makes":"fails")}>
<p class="verdict"><b>${s?"The robot makes it":"The robot does not make it"}</b>${s?Q`: arrives with ${H(V(o,o>.995?2:1))} charge, ${H(J(n))} above its reserve of ${H(V(a.reserve_fraction))}.`:Q`: ${H(J(-n))} short of its reserve of ${H(V(a.reserve_fraction))}.`}</p>
<p class="note">Starts with ${H(V(a.state_of_charge,1))}, ${H(J(a.usable_energy_j))} usable${r>=2?`: ${W(r)} such drives`:""}. At its ${"model"===a.consumption.basis?"modelled":"recent"} consumption it has ${H(G(a.range_m))} or ${K(a.run_time_s)} left.</p></div>`}var rt={fleet:function(){x("Fleet");let e=s(),t=r(),a=function(){let[e,t]=E(new Map);return A(()=>{let e=()=>te("/v1/autonomy",{}).then(e=>t(new Map(e.robots.map(e=>[e.robot_id,e.range_quantiles_m]))),()=>{});e();let a=setInterval(e,3e4);return()=>clearInterval(a)},[]),e}(),[n,l]=E(""),[o,i]=E("all"),[d,u]=E({key:"robot",down:!1}),c=function(e,t,a,n){let s=R({key:"",at:-1/0,rows:[]}),l=`${t}|${a}|${n.key}|${n.down}|${e.robots.size}`,o=performance.now();if(s.current.key!==l||o-s.current.at>3e3){let r=oe.find(e=>e.key===n.key),i=function(e,t,a){let n=t.trim().toLowerCase(),s={all:()=>!0,live:e=>e.live,silent:e=>!e.live,mission:e=>null!==e.mission,low:e=>null!==e.state_of_charge&&e.state_of_charge<.25}[a];return[...e.values()].filter(e=>s(e.state)&&(""===n||e.id.toLowerCase().includes(n)||(e.state.mission?.mission_id??"").toLowerCase().includes(n)))}(e.robots,t,a).sort((e,t)=>(n.down?-1:1)*r.sort(e,t)||le.compare(e.id,t.id));s.current={key:l,at:o,rows:i}}return s.current.rows}(e,n,o,d),[h,$,m]=function(e){let t=R(null),[a,n]=E([0,40]);return A(()=>{let a=()=>{if(null===t.current)return;let a=t.current.getBoundingClientRect().top,s=Math.max(0,Math.floor(-a/46)-8),l=Math.min(e,Math.ceil((innerHeight-a)/46)+8);n(e=>e[0]===s&&e[1]===l?e:[s,l])};return a(),addEventListener("scroll",a,{passive:!0}),addEventListener("resize",a),()=>{removeEventListener("scroll",a),removeEventListener("resize",a)}},[e]),[t,Math.min(a[0],e),Math.min(Math.max(a[1],0),e)]}(c.length);return e.loaded||0!==e.robots.size?0===e.robots.size?Q`<h1>Fleet</h1><${p} title="No robot yet">A robot appears here when its telemetry arrives over LCM or its file is put to <code>/v1/robots/…</code>.<//>`:Q`
<h1 class="hidden">Fleet</h1>
<${ue} robots=${e.robots} />
<div class="tools">
<label class="find"><span class="hidden">Find a robot or mission</span><input type="search" placeholder="Find a robot or mission" value=${n} onInput=${e=>l(e.currentTarget.value)} /></label>
<${v} label="Show" value=${o} onChange=${i} options=${[["all","All"],["live","Live"],["silent","Silent"],["mission","On a mission"],["low","Low charge"]]} />
<span class="key"><span class="swatch measured"></span>measured <span class="swatch modelled"></span>modelled</span>
</div>
<table class="grid fleet" aria-rowcount=${c.length+1}>
<thead><tr>${oe.map(e=>Q`<th key=${e.key} scope="col" class=${e.class} aria-sort=${(e=>e.key!==d.key?void 0:d.down?"descending":"ascending")(e)}>
${e.sort?Q`<button type="button" onClick=${()=>(e=>u(t=>({key:e,down:t.key===e&&!t.down})))(e.key)}>${e.title}<span class="arrow" aria-hidden="true">${e.key===d.key?d.down?"▾":"▴":""}</span></button>`:e.title}</th>`)}</tr></thead>
<tbody ref=${h}>
${$>0&&Q`<tr key="above" aria-hidden="true" class="spacer"><td colspan=${oe.length} style=${{height:46*$+"px"}}></td></tr>`}
${c.slice($,m).map((e,n)=>Q`<${de} key=${e.id} entry=${e} revision=${e.revision} index=${$+n} dark=${t} band=${a.get(e.id)} />`)}
${m<c.length&&Q`<tr key="below" aria-hidden="true" class="spacer"><td colspan=${oe.length} style=${{height:46*(c.length-m)+"px"}}></td></tr>`}
</tbody>
</table>
${0===c.length&&Q`<${p} title="No robot matches" />`}`:null!==e.error?Q`<${f} error=${e.error} />`:Q`<${g} what="the fleet" />`},robots:function({id:n}){x(n);let l=s(),o=r(),i=a(`/v1/robots/${t(n)}`),d=a(`/v1/missions${e({robot_id:n,limit:12})}`),u=l.robots.get(n),h=u?.state,$=h?.mission?.id;return A(()=>{null!==d.value&&d.reload()},[$]),!h&&l.loaded&&404===i.error?.status?Q`<${p} title=${`There is no robot ${n}`}>See the <a href="#/fleet">fleet</a>.<//>`:Q`
<div class="heading"><p class="crumbs"><a href="#/fleet">Fleet</a></p><h1>${n}</h1>
${h&&Q`<span class="health"><${re} state=${h} /></span>`}
<span class="spring"></span><a class="button" href=${`#/plan${e({robot:n})}`}>Plan a drive</a></div>
${h&&Q`<dl class="readouts">
<${m} large label=${null===h.measured_power_w?"Power (modelled)":"Power"} of=${U(h.measured_power_w??h.modelled_power_w)} channel=${null===h.measured_power_w?"modelled":"measured"} note=${Q`<${ae} track=${u.power} revision=${u.revision} dark=${o} width=${120} height=${26} />`} />
<${m} large label="Charge" of=${V(h.state_of_charge)} note=${null===h.battery_voltage_v?"":H(q(h.battery_voltage_v,"V",2))} />
<${m} large label="Range" of=${G(h.range_m)} />
<${m} large label="Run time" of=${K(h.run_time_s)} />
<${m} large label="Speed" of=${q(h.speed_m_s,"m/s",2)} />
<${m} large label="Payload" of=${q(h.payload_kg,"kg")} />
<${m} large label="Windings, right · left" of=${null===h.winding_temperature_c[0]?"–":`${W(h.winding_temperature_c[0])} · ${W(h.winding_temperature_c[1])} °C`} />
<${m} large label="Mission" of=${J(h.mission?.energy.battery_j)} note=${h.mission?Q`<a href=${c(h.mission.id)}>${h.mission.mission_id}</a>`:"none running"} />
</dl>`}
<${$e} part="RobotHistory" id=${n} />
<${b} title="Recent missions" aside=${Q`<a href=${`#/missions${e({robot:n})}`}>All missions of ${n}</a>`}><${_} of=${d} what="missions">${e=>0===e.missions.length?Q`<${p} title="No mission yet" />`:Q`<div class="scroll"><${Ne} missions=${e.missions} with_robot=${!1} /></div>`}<//><//>
<div class="columns">
<${b} class="screen" title="On the floor now">${u?Q`<${Ae} entry=${u} />`:Q`<${p} title="Never heard" />`}<//>
<${b} title="Model">${i.value?Q`<${De} model=${i.value.model} />`:Q`<p class="note">none</p>`}<//>
</div>`},missions:function({given:t}){x("Missions");let[n,s]=E(t),[l,o]=E([""]),r=R(JSON.stringify(t));A(()=>{JSON.stringify(t)!==r.current&&(r.current=JSON.stringify(t),s(t),o([""]))},[t]);let i=F(()=>Te(n),[n]),d=l[l.length-1],u=a(`/v1/missions${e({...i,limit:50,cursor:d})}`),c=a(`/v1/mission-totals${e(i)}`);return Q`
<h1 class="hidden">Missions</h1>
<${Pe} given=${n} change=${e=>{let t=Object.fromEntries(Object.entries(e).filter(([,e])=>""!==e));r.current=JSON.stringify(t),s(t),o([""]),h("missions",t)}} />
<${Oe} told=${c} />
<div class="tools"><button type="button" onClick=${()=>{u.reload(),c.reload()}}>Refresh</button>
<span class="note">Times are local (${Intl.DateTimeFormat().resolvedOptions().timeZone})</span>
<${Ee} given=${n} total=${c.value?.missions??0} /></div>
<${_} of=${u} what="missions">${({missions:e,next_cursor:t})=>Q`
${u.error&&Q`<${f} error=${u.error} retry=${u.reload} />`}
<div class=${u.loading?"stale":""} aria-busy=${String(u.loading)}>
${0===e.length?Q`<${p} title=${Object.keys(n).length>0?"No mission matches":"No mission yet"}>Missions appear when a robot announces one or sends telemetry.<//>`:Q`<div class="scroll"><${Ne} missions=${e} /></div>`}
</div>
<nav class="pages" aria-label="Pages of missions">
<button type="button" disabled=${1===l.length} onClick=${()=>o(l.slice(0,-1))}>Newer</button>
<span>${W(50*(l.length-1)+Math.min(1,e.length))} – ${W(50*(l.length-1)+e.length)}${c.value?` of ${W(c.value.missions)}`:""}</span>
<button type="button" disabled=${null===t} onClick=${()=>o([...l,t])}>Older</button>
</nav>`}<//>`},mission:function({id:n}){let s=a(`/v1/missions/${t(n)}`),l=a(`/v1/missions/${t(n)}/ledger`),o=a(`/v1/missions/${t(n)}/trace${e({points:700})}`),r=null!==o.value&&o.value.start_utime_us.length>=350,i=a(r?`/v1/missions/${t(n)}/trace${e({points:6e3})}`:null),d=r?i.value:o.value;x(s.value?.mission_id??"Mission");let c="open"===s.value?.state;return A(()=>{if(!c)return;let e=setInterval(()=>[s,l,o].forEach(e=>e.reload()),3e3);return()=>clearInterval(e)},[c]),Q`<${_} of=${s} what="the mission">${e=>{let t=e.energy,a=Ce(t);return Q`
<div class="heading"><p class="crumbs"><a href="#/missions">Missions</a> / <a href=${u(e.robot_id)}>${e.robot_id}</a></p>
<h1>${e.mission_id}</h1><${w} mission=${e} />
${e.incomplete&&Q`<span class="flag">incomplete${e.incomplete_reason?`: ${Z(e.incomplete_reason)}`:""}</span>`}
<span class="note">${X(e.start_utime_us)}</span></div>
<dl class="readouts">
<${m} large label=${null===t.measured_j?"From the battery (modelled)":"From the battery"} of=${J(t.battery_j)} channel=${null===t.measured_j?"modelled":"measured"} />
<${m} large label="Modelled" of=${J(t.modelled_j)} channel="modelled" />
<${m} large label="Unexplained" of=${(()=>{let e=J(t.unexplained_j);return{n:B(e.n),u:e.u}})()} channel="gap" note=${null===a?"":`ratio ${W(a,3)}`} />
<${m} large label="Distance" of=${G(t.distance_m)} />
<${m} large label="Duration" of=${K(t.duration_s)} />
<${m} large label="Per metre" of=${q(t.distance_m>.1?t.battery_j/t.distance_m:null,"J/m")} />
<${m} large label="Payload" of=${q(e.payload_kg,"kg")} />
</dl>
<${_} of=${o} what="the trace">${t=>Q`<${Je} mission=${e} whole=${t} fine=${d??t} />`}<//>
<div class="columns">
<${b} title="Where the energy went"><${_} of=${l} what="the ledger">${({ledger:e})=>Q`<${Fe} terms_j=${e.terms_j} battery_j=${e.battery_j} closure=${e.closure_relative} />`}<//><//>
<div>
<${b} title="Against the minimum-energy drive">${null===e.model_version?Q`<${p} title="No model">The robot had no model on this mission.<//>`:c?Q`<${p} title="Still driving">Compared when the mission ends.<//>`:e.gap_s>0?Q`<${p} title="Not compared">For ${K(e.gap_s)} of the mission nothing is known.<//>`:d&&Q`<${Ue} mission=${e} trace=${d} />`}<//>
<${b} title="Record"><${Ge} mission=${e} /><//>
</div>
</div>`}}<//>`},plan:function({given:e}){x("Plan");let a=s(),n=[...a.robots.values()].filter(e=>e.state.has_model).map(e=>e.id).sort(),[l,o]=E(e.robot??""),[r,i]=E("legs"),[d,u]=E(et),[c,$]=E([[-5,-2],[2,-2],[2,2.5],[5,2.5]]),[_,y]=E({payload:"",deadline:"",value:"",charge:""}),[w,k]=E({answer:null,error:null,busy:!1,autonomy:{value:null,error:null},straight:!1}),M=R(null),j=n.includes(l)?l:n[0]??"",T=F(()=>"legs"===r?function(e){let[t,a,n]=[0,0,0],s=[[t,a]];for(let l of e)if("straight"===l.kind)t+=l.length*Math.cos(n),a+=l.length*Math.sin(n),s.push([t,a]);else if("turn"===l.kind)n+=l.angle*Ve;else if("arc"===l.kind){let e=l.angle<0?-1:1,o=Math.max(2,Math.ceil(Math.abs(l.angle)/5)),r=t-e*l.radius*Math.sin(n),i=a+e*l.radius*Math.cos(n);for(let t=1;t<=o;++t){let a=n+l.angle*Ve*t/o;s.push([r+e*l.radius*Math.sin(a),i-e*l.radius*Math.cos(a)])}n+=l.angle*Ve,[t,a]=s[s.length-1]}return s}(d).filter(([e,t])=>Number.isFinite(e+t)):c,[r,d,c]),C=F(()=>w.answer?.profile.x_m.map((e,t)=>[e,w.answer.profile.y_m[t],w.answer.profile.power_w[t]]),[w.answer]),N=async(e={})=>{let n={..._,...e},s=e=>""===e?void 0:Number(e);if("draw"===r&&c.length<2)return void k(e=>({...e,error:Object.assign(new Error("Draw at least two points."),{title:"No path yet"})}));M.current?.abort();let l=M.current=new AbortController;k(e=>({...e,busy:!0,error:null}));let o={..."draw"===r?Xe(c):{path:d.map(Ke)},payload_kg:s(n.payload),deadline_s:s(n.deadline),value_of_time_w:s(n.value),pareto_points:24},i=s(n.charge),u=`/v1/robots/${t(j)}`,h=void 0!==i||null!==a.robots.get(j)?.state.state_of_charge?te(`${u}/autonomy`,{state_of_charge:void 0===i?void 0:i/100,payload_kg:o.payload_kg},l.signal).then(e=>({value:e,error:null}),e=>({value:null,error:e})):{value:null,error:null};try{let e=await te(`${u}/profile`,o,l.signal);k({answer:e,of:T,error:null,busy:!1,autonomy:await h,straight:1===o.path.length&&"straight"===o.path[0].kind})}catch(e){"AbortError"!==e.name&&k(t=>({...t,error:e,busy:!1}))}};if(A(()=>(""!==j&&N(),()=>M.current?.abort()),[j]),a.loaded&&0===n.length)return Q`<h1>Plan</h1><${p} title="No robot has a model">Put a robot file to <code>/v1/robots/…</code> to plan with it.<//>`;if(!a.loaded)return Q`<${g} what="the fleet" />`;let S=(e,t,a,n)=>Q`<label class="field"><span>${t}</span><span class="with-unit"><input type="number" step="any" min="0" value=${_[e]} onInput=${t=>y({..._,[e]:t.currentTarget.value})} ...${n} /><span class="unit">${a}</span></span></label>`,P=w.answer,O=/^\/path\/(\d+)/.exec(w.error?.field??""),D=P?.baselines;return Q`<h1 class="hidden">Plan</h1><div class="plan">
<form class="plan-form" onSubmit=${e=>{e.preventDefault(),N()}}>
<label class="field"><span>Robot</span><select value=${j} onChange=${e=>{o(e.currentTarget.value),h("plan",{robot:e.currentTarget.value})}}>${n.map(e=>Q`<option key=${e} value=${e}>${e}</option>`)}</select></label>
<${v} label="How to give the path" value=${r} onChange=${i} options=${[["legs","Enter legs"],["draw","Draw"]]} />
${"legs"===r?Q`<${tt} legs=${d} change=${u} fault=${O?Number(O[1]):null} />`:Q`<p class="note">${c.length} points, ${H(G(c.slice(1).reduce((e,[t,a],n)=>e+Math.hypot(t-c[n][0],a-c[n][1]),0)))}. Draw on the floor.</p>`}
<div class="terms">
${S("payload","Payload","kg",{placeholder:"0"})}
${S("deadline","Deadline","s",{placeholder:"free"})}
${S("value","Value of time","W",{placeholder:"0"})}
${S("charge","Charge now","%",{placeholder:"live",max:100})}
</div>
<button type="submit" class="primary" disabled=${""===j}>${w.busy?"Computing …":"Compute"}</button>
</form>
<div class="plan-result" aria-live="polite" aria-busy=${String(w.busy)}>
${w.error&&Q`<${f} error=${w.error} />`}
${"draw"===r&&Q`<${b} class="screen" title="Draw the path"><${Qe} points=${c} change=${$} /><//>`}
${null===P?null===w.error&&Q`<${g} what="the plan" />`:Q`<div class=${w.busy?"stale":""}>
<${ot} answer=${P} autonomy=${w.autonomy} />
<dl class="readouts">
<${m} large label="Least energy" of=${J(P.energy_j)} channel="accent" />
<${m} large label="Duration" of=${K(P.duration_s)} />
<${m} large label="Distance" of=${G(P.distance_m)} />
<${m} large label="Top speed" of=${q(P.peak_speed_m_s,"m/s",2)} />
<${m} large label="Per metre" of=${q(P.distance_m>0?P.energy_j/P.distance_m:null,"J/m")} />
</dl>
<div class="columns">
<${b} class="screen" title="Speed and power"><${nt} answer=${P} straight=${w.straight} /><//>
<${b} class="screen" title="On the floor"><${we} points=${C} under=${w.of===T?null:T} height=${340} label="The planned path, coloured by power; circle: start, square: end" /><//>
</div>
<div class="columns">
<${b} title="Against the usual profiles">
<${Le} label="Energy of the plan, a trapezoid and a triangle in the same time" rows=${[{name:"Least energy",value:P.energy_j,of:J(P.energy_j),channel:"least",note:""},...["trapezoid","triangle"].map(e=>({name:e[0].toUpperCase()+e.slice(1),value:D[e]?.energy_j??null,of:J(D[e]?.energy_j),channel:"plain",note:D[e]?`${D[e].within_limits?"":"breaks the limits; "}we save ${H(V(D[e].saving_fraction,1))}`:"not possible here"}))]} />
<p class="note foot">All three in the same time on every run between stops.</p>
<//>
<${b} class="screen" title="Energy against time">${P.pareto.length<2?Q`<${p} title="No front">Nothing to trade: time and energy do not compete on this path.<//>`:Q`<${st} answer=${P} take=${({duration_s:e})=>{let t=String(Math.ceil(100*e)/100);y({..._,deadline:t}),N({deadline:t})}} />`}<//>
</div>
<div class="columns">
<${b} title="Where the energy goes"><${Fe} terms_j=${P.ledger_j} battery_j=${P.energy_j} measured=${!1} /><//>
<${b} title="How sure the optimum is"><${lt} answer=${P} /><//>
</div></div>`}
${"legs"===r&&null===P&&T.length>1&&Q`<${b} class="screen" title="Path"><${we} points=${T.map(([e,t])=>[e,t,NaN])} legend=${!1} label="The path that was entered" /><//>`}
</div></div>`},gap:e=>Q`<${$e} part="Gap" ...${e} />`};function it(){let e=s(),t={live:"Live",connecting:"Connecting",offline:"Offline"}[e.link];return Q`<span class=${`link ${e.link}`} role="status"><span class="lamp" aria-hidden="true"></span>${t}</span>`}function dt(){let e=s(),[t,a]=E(!1);if(A(()=>{if(a(!1),"offline"!==e.link)return;let t=setTimeout(()=>a(!0),1500);return()=>clearTimeout(t)},[e.link]),!t)return null;let n=Y(1e3*e.since_ms);return Q`<div class="banner" role="alert">No connection to the service since ${n}. What is shown is as of then; trying again.</div>`}n(),P(Q`<${function(){let[e,t]=E(d(location.hash)),a=R(null),n=R(!0),s=r();A(()=>{let e=()=>t(d(location.hash));return addEventListener("hashchange",e),()=>removeEventListener("hashchange",e)},[]),A(()=>{n.current?n.current=!1:(scrollTo(0,0),a.current.focus({preventScroll:!0}))},[e.view,e.id]);let l=rt[e.view],i={robots:"fleet",mission:"missions"}[e.view]??e.view,u=(e,t)=>Q`<a href=${`#/${e}`} aria-current=${i===e?"page":void 0}>${t}</a>`;return Q`
<a class="skip" href="#main" onClick=${e=>{e.preventDefault(),a.current.focus()}}>Skip to content</a>
<header class="top">
<a class="mark" href="#/fleet" aria-label="joulecast, fleet">
<svg viewBox="0 0 32 20" width="38" height="24" aria-hidden="true"><path d="M1 14h6l4-12 6 17 4-10 2 5h8" /></svg>joulecast</a>
<nav aria-label="Views">${u("fleet","Fleet")}${u("missions","Missions")}${u("plan","Plan")}${u("gap","Gap")}</nav>
<${it} />
<button type="button" class="theme" onClick=${o} aria-label=${s?"Light theme":"Dark theme"} title=${s?"Light theme":"Dark theme"}>
<svg viewBox="0 0 20 20" width="18" height="18" aria-hidden="true"><circle cx="10" cy="10" r="7.5" class="ring" /><path d="M10 2.5a7.5 7.5 0 0 1 0 15z" /></svg></button>
</header>
<${dt} />
<main id="main" tabindex="-1" ref=${a}>
<${k} view=${location.hash}>
${l?Q`<${l} key=${`${e.view}/${e.id??""}`} id=${e.id} given=${e.given} />`:Q`<${p} title="There is no such page">Go to the <a href="#/fleet">fleet</a>.<//>`}
<//>
</main>`}} />`,document.getElementById("app"));
