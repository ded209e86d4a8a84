/* joulecast operator page, built from source/; licences: third_party.txt */
import{B as e,C as t,D as a,E as n,F as s,G as l,H as r,I as o,J as i,K as d,L as u,M as c,N as h,O as $,P as m,Q as p,R as g,S as f,T as _,U as b,V as v,W as y,X as w,Y as k,Z as x,_ as M,a as j,aa as T,b as C,ba as S,c as N,ca as P,d as E,da as O,e as D,f as A,g as L,h as R,i as z,j as F,k as W,l as B,m as I,n as J,o as U,p as G,q as H,r as q,s as V,t as K,u as X,v as Y,w as Z,x as Q,y as ee,z as te}from"./base.js";var ae=class extends C{canvas=j();shouldComponentUpdate(e){return e.revision!==this.props.revision||e.dark!==this.props.dark||e.track!==this.props.track}componentDidMount(){this.draw()}componentDidUpdate(){this.draw()}draw(){let e=this.canvas.current,{width:t=128,height:a=30,track:n}=this.props,s=devicePixelRatio||1,l=e.getContext("2d"),r=i();e.width!==t*s&&(e.width=t*s,e.height=a*s),l.setTransform(s,0,0,s,0,0),l.clearRect(0,0,t,a),l.strokeStyle=r.graticule,l.lineWidth=1,l.beginPath();for(let e=t-.5;e>0;e-=32)l.moveTo(e,0),l.lineTo(e,a);let o=n.last(),d=1,u=0;for(let[,e,t]of o)e>d&&(d=e),t>d&&(d=t),e<u&&(u=e);let c=e=>a-2-(e-u)/(d-u)*(a-5);if(l.moveTo(0,Math.round(c(0))+.5),l.lineTo(t,Math.round(c(0))+.5),l.stroke(),o.length<2)return;let h=o[o.length-1][0];for(let[e,a,n]of[[2,r.modelled,1],[1,r.measured,1.5]]){l.strokeStyle=a,l.lineWidth=n,l.lineJoin="round",l.beginPath();let s=-1/0;for(let a of o){let n=t-2-(h-a[0])/9e7*t;Number.isFinite(a[e])&&(a[0]-s>5e6?l.moveTo(n,c(a[e])):l.lineTo(n,c(a[e])),s=a[0])}l.stroke()}}render(){let{width:e=128,height:t=30}=this.props;return Q`<canvas class="sparkline" ref=${this.canvas} style=${{width:`${e}px`,height:`${t}px`}} aria-hidden="true"></canvas>`}};function ne(e){let[t,a]=E(new Map);return D(()=>{let t=()=>te("/v1/autonomy",e?{robots:[e]}:{}).then(e=>a(new Map(e.robots.map(e=>[e.robot_id,{range:e.range_quantiles_m,time:e.run_time_quantiles_s}]))),()=>{});t();let n=setInterval(t,3e4);return()=>clearInterval(n)},[e]),t}function se(e,t){if(!z(e?.p05)||!z(e.p95))return"";let a=t(e.p05),n=t(e.p95);return Q`<span title="nine times of ten"><span class="hidden">90 % between </span>${a.u===n.u||"0"===a.n?a.n:q(a)}–${q(n)}</span>`}function le({live:e,band:t}){return Q`<${$} of=${U(t?.p50??e)} /><span class="below">${se(t,U)}</span>`}var re=e=>(t,a)=>{let n=e(t.state),s=e(a.state);return(null==n)-(null==s)||(n<s?-1:n>s?1:0)},oe=new Intl.Collator("en",{numeric:!0}),ie=[{key:"robot",title:"Robot",sort:(e,t)=>oe.compare(e.id,t.id),class:"robot"},{key:"health",title:"Telemetry",sort:re(e=>e.live?0:null===e.silent_s?1/0:1+e.silent_s),class:"health"},{key:"power",title:"Power",sort:re(e=>e.measured_power_w??e.modelled_power_w),class:"figure power"},{key:"trace",title:"Last 90 s",class:"spark"},{key:"charge",title:"Charge",sort:re(e=>e.state_of_charge),class:"charge"},{key:"range",title:"Range",sort:re(e=>e.range_m),class:"figure range"},{key:"time",title:"Run time",sort:re(e=>e.run_time_s),class:"figure wide"},{key:"speed",title:"Speed",sort:re(e=>e.speed_m_s),class:"figure wide"},{key:"mission",title:"Mission",sort:re(e=>e.mission?.start_utime_us),class:"mission"},{key:"spent",title:"Spent",sort:re(e=>e.mission?.energy.battery_j),class:"figure spent"}],de=e=>null===e.silent_s;function ue({state:e}){let{level:t,text:a,faults:n}=function(e){let t=Object.values(e.faults).reduce((e,t)=>e+t,0);return e.has_model?e.live?{level:"good",text:"live",faults:t}:de(e)?{level:"none",text:"not heard",faults:t}:{level:"bad",text:`silent ${V(e.silent_s)}`,faults:t}:{level:"bad",text:"no model",faults:t}}(e),s=Object.entries(e.faults).map(([e,t])=>`${t} ${Z(e)}`).join(", ");return Q`<span class=${`lamp ${t}`} aria-hidden="true"></span>${a}
${n>0&&Q`<span class="note" title=${s}> · ${F(n)} faulty</span>`}`}function ce({charging:e,charge:t,state_of_charge_sd:a}){let n=t?.time_to_charged_s;return"full"===e?.phase?{text:"charged",what:"At its charger, which has ended"}:e?{text:"charging"+(z(n)?`, ${K(n)}`:""),what:"At its charger"+(z(n)?`, ready in ${K(n)}`:"")}:{text:z(a)?`± ${q(G(a))}`:"",what:"standard deviation"}}function he({state:e}){let t=e.state_of_charge;if(null===t)return Q`<span class="note">unknown</span>`;let{text:a,what:n}=ce(e);return Q`<span class=${"charge-bar "+(e.charging?"charging":t<.25?"low":"")} aria-hidden="true"><span style=${{width:`${Math.max(2,100*t)}%`}}></span></span>
<${$} of=${G(t)} /><span class="below" title=${n}>${a}</span>`}var $e=class extends C{shouldComponentUpdate(e){return e.revision!==this.props.revision||e.entry!==this.props.entry||e.index!==this.props.index||e.dark!==this.props.dark||e.band!==this.props.band}render({entry:e,index:t,revision:a,dark:n,band:s}){let l=e.state,r=null===l.measured_power_w;return Q`<tr aria-rowindex=${t+2} class=${l.live?"":"quiet"}>
<th scope="row" class="robot"><a href=${u(e.id)}>${e.id}</a></th>
<td class="health"><${ue} state=${l} /></td>
<td class="figure power"><${$} of=${J(l.measured_power_w??l.modelled_power_w)} />${r&&null!==l.modelled_power_w&&Q`<span class="note"> mod.</span>`}</td>
<td class="spark"><${ae} track=${e.power} revision=${a} dark=${n} /></td>
<td class="charge"><${he} state=${l} /></td>
<td class="figure range"><${le} live=${l.range_m} band=${s} /></td>
<td class="figure wide">${K(l.run_time_s)}</td>
<td class="figure wide"><${$} of=${H(l.speed_m_s,"m/s",2)} /></td>
<td class="mission">${l.mission?Q`<a href=${c(l.mission.id)}>${l.mission.mission_id}</a>`:Q`<span class="note">idle</span>`}</td>
<td class="figure spent"><${$} of=${I(l.mission?.energy.battery_j)} /></td>
</tr>`}};function me({robots:e}){let[t,a,n,s,l,r,o,i]=[0,0,0,0,null,!1,0,0];for(let{state:d}of e.values()){let e=d.measured_power_w??d.modelled_power_w;d.live&&(a+=1,null!==d.charging?(o+=1,i-=Math.min(0,d.measured_power_w??0)):null!==e&&(t+=e,r=!0)),null!==d.mission&&(n+=1,s+=d.mission.energy.battery_j),null!==d.state_of_charge&&(null===l||d.state_of_charge<l.state_of_charge)&&(l=d)}return Q`<dl class="readouts">
<${m} large label="Fleet power" of=${r?J(t):{n:"–",u:""}} channel="measured" />
<${m} large label="Live" of=${`${a}`} note=${`of ${e.size}`} />
<${m} large label="On a mission" of=${`${n}`} />
<${m} large label="Spent in running missions" of=${I(n>0?s:null)} />
${o>0&&Q`<${m} large label="Charging" of=${`${o}`} note=${`at ${q(J(i))}`} />`}
<${m} large label="Lowest charge" of=${G(l?.state_of_charge)} note=${l&&Q`<a href=${u(l.robot_id)}>${l.robot_id}</a>`} />
</dl>`}var pe=null,ge=null;function fe({part:e,...t}){let[,a]=E(0),[n,s]=E(null),l=()=>a(e=>e+1),r=()=>{s(null),document.getElementById("gap-style")||document.head.append(Object.assign(document.createElement("link"),{id:"gap-style",rel:"stylesheet",href:"gap-style.css"})),(pe??=import("./gap.js").then(e=>{ge=e},e=>{throw pe=null,e}),pe).then(l,()=>s({status:0,title:"This part of the page could not be loaded",message:"The service may be restarting, or the network is down."}))};if(D(()=>{null===ge&&r()},[]),null!==n)return Q`<${f} error=${n} retry=${r} />`;if(null===ge)return Q`<${g} what="this part of the page" />`;let o=ge[e];return Q`<${o} ...${t} />`}var _e={light:[[200,206,196],[226,178,92],[212,104,44],[150,38,48],[72,14,52]],dark:[[44,58,62],[104,72,104],[196,82,72],[250,152,56],[255,238,170]]},be={light:[[20,84,140],[120,170,200],[196,196,190],[226,140,100],[172,36,34]],dark:[[70,170,255],[60,106,150],[78,84,84],[176,92,64],[255,120,84]]};function ve(e,t,a,n,s){return{scale:e,width:n,height:s,to:(l,r)=>[n/2+(l-t)*e,s/2-(r-a)*e],from:(l,r)=>[t+(l-n/2)/e,a-(r-s/2)/e]}}function ye(e){let t=10**Math.floor(Math.log10(e));return[5,2,1].map(e=>e*t).find(t=>t<=e)??t}function we(e,t){let a=i(),n=ye(90/t.scale),[s,l]=t.from(0,0),[r,o]=t.from(t.width,t.height);e.strokeStyle=a.graticule,e.lineWidth=1,e.beginPath();for(let a=Math.ceil(s/n)*n;a<=r;a+=n){let n=Math.round(t.to(a,0)[0])+.5;e.moveTo(n,0),e.lineTo(n,t.height)}for(let a=Math.ceil(o/n)*n;a<=l;a+=n){let n=Math.round(t.to(0,a)[1])+.5;e.moveTo(0,n),e.lineTo(t.width,n)}e.stroke()}function ke(e,t){let a=i(),n=ye(120/t.scale),s=n*t.scale,l=14.5,r=t.height-14.5;e.strokeStyle=e.fillStyle=a.ink,e.lineWidth=1.5,e.beginPath(),e.moveTo(l,r-5),e.lineTo(l,r),e.lineTo(l+s,r),e.lineTo(l+s,r-5),e.stroke(),e.font='12px "Liberation Sans", "Helvetica Neue", Arial, sans-serif',e.textAlign="left",e.textBaseline="alphabetic",e.fillText(`${W(n,1)} m`,l+s+6,r)}function xe(e,t,a,n,s,l){let[r,o]=t.to(a,n);e.save(),e.translate(r,o),e.rotate(-s),e.fillStyle=l,e.strokeStyle=i().screen,e.lineWidth=2,e.beginPath(),e.moveTo(11,0),e.lineTo(-7,7),e.lineTo(-3.5,0),e.lineTo(-7,-7),e.closePath(),e.stroke(),e.fill(),e.restore()}function Me({draw:e,height:t,label:a,changes:n,...s}){let l=L(null),r=L(e),i=o();r.current=e;let d=()=>{let e=l.current,a=devicePixelRatio||1,n=e?.clientWidth??0;if(0===n)return;(e.width!==Math.round(n*a)||e.height!==Math.round(t*a))&&(e.width=Math.round(n*a),e.height=Math.round(t*a));let s=e.getContext("2d");s.setTransform(a,0,0,a,0,0),s.clearRect(0,0,n,t),r.current(s,n,t)};return A(()=>{let e=new ResizeObserver(d);return e.observe(l.current),()=>e.disconnect()},[t]),D(d,[i,...n]),Q`<canvas class="floor" role="img" aria-label=${a} ref=${l} style=${{height:`${t}px`}} ...${s}></canvas>`}function je({points:e,kind:t="power",height:a=380,label:n,cursor:s=null,robot:r=null,legend:d=!0,ends:u=!0,under:c=null}){let h=e.filter(([e,t])=>Number.isFinite(e)&&Number.isFinite(t)),$=o(),m=function(e,t){let a=t.filter(Number.isFinite).map(t=>"gap"===e?Math.abs(t):t).sort((e,t)=>e-t),n=Math.max(a.length>0?a[Math.floor(.98*(a.length-1))]:1,.001),s=10**Math.floor(Math.log10(n))/2,r=Math.ceil(n/s)*s,o="gap"===e?-r:0,i=function(e){let t=[];for(let a=0;a<64;++a){let n=a/63*(e.length-1),s=Math.min(Math.floor(n),e.length-2),l=n-s,r=e[s].map((t,a)=>Math.round(t+(e[s+1][a]-t)*l));t.push(`rgb(${r.join(" ")})`)}return t}(("gap"===e?be:_e)[l()?"dark":"light"]);return{low:o,high:r,colours:i,colour_of:e=>i[Math.max(0,Math.min(63,Math.round((e-o)/(r-o)*63)))]}}(t,h.map(e=>e[2]));return Q`<div class="floor-box">
<${Me} draw=${(t,a,n)=>{let l=function(e,t,a,n=28,s=2){let[l,r,o,i]=[1/0,-1/0,1/0,-1/0];for(let[t,a]of e)!Number.isFinite(t)||!Number.isFinite(a)||(l=Math.min(l,t),r=Math.max(r,t),o=Math.min(o,a),i=Math.max(i,a));return l>r&&([l,r,o,i]=[-s,s,-s,s]),ve(Math.min((t-2*n)/Math.max(r-l,s),(a-2*n)/Math.max(i-o,s)),(l+r)/2,(o+i)/2,t,a)}([...h,...r?[r]:[],...c??[]],a,n,34);we(t,l),null!==c&&function(e,t,a){e.strokeStyle=i().muted,e.lineWidth=1.25,e.setLineDash([5,4]),e.beginPath(),a.forEach(([a,n],s)=>e[0===s?"moveTo":"lineTo"](...t.to(a,n))),e.stroke(),e.setLineDash([])}(t,l,c),t.lineWidth=3.2,t.lineCap="round",t.lineJoin="round";let o=null;for(let e=1;e<h.length;++e){let a=h[e][2],n=Number.isFinite(a)?m.colour_of(a):i().line;n!==o&&(null!==o&&t.stroke(),t.strokeStyle=o=n,t.beginPath(),t.moveTo(...l.to(h[e-1][0],h[e-1][1]))),t.lineTo(...l.to(h[e][0],h[e][1]))}null!==o&&t.stroke(),h.length>1&&u&&function(e,t,a){let n=i(),s=a[0],l=a[a.length-1];e.lineWidth=2,e.strokeStyle=n.ink,e.fillStyle=n.screen;let[r,o]=t.to(s[0],s[1]);e.beginPath(),e.arc(r,o,5,0,7),e.fill(),e.stroke();let[d,u]=t.to(l[0],l[1]);e.fillStyle=n.ink,e.fillRect(d-4.5,u-4.5,9,9)}(t,l,h),r&&xe(t,l,r[0],r[1],r[2]??0,i().ink);let d=null===s?null:e[s];if(d&&Number.isFinite(d[0])){let[e,s]=l.to(d[0],d[1]);t.strokeStyle=i().ink,t.lineWidth=1,t.beginPath(),t.moveTo(e,0),t.lineTo(e,n),t.moveTo(0,s),t.lineTo(a,s),t.stroke(),t.fillStyle=i().accent,t.beginPath(),t.arc(e,s,6,0,7),t.fill(),t.stroke()}ke(t,l)}} height=${a} label=${n} changes=${[e,t,s,r,c]} />
${d&&h.some(e=>e[2]>0||"gap"===t)&&Q`<${Te} scale=${m} dark=${$} title=${"gap"===t?"measured − modelled":"power"} />`}
</div>`}function Te({scale:e,title:t,unit:a="W"}){let n=(e.low+e.high)/2;return Q`<div class="legend">
<span class="legend-title">${t}</span>
<span class="number">${W(e.low,2)}</span>
<${Me} draw=${(t,a,n)=>{let s=a/e.colours.length;e.colours.forEach((e,a)=>{t.fillStyle=e,t.fillRect(a*s,0,s+1,n)})}} height=${10} label=${`Colours from ${e.low} to ${e.high} ${a}`} changes=${[e.low,e.high,t]} />
<span class="number">${W(e.high,2)}${" "}${a}</span>
${"power"!==t&&Q`<span class="note">neutral at ${W(n,1)}</span>`}
</div>`}var Ce={id:e=>e.id,robot_id:e=>e.robot_id,mission_id:e=>e.mission_id,state:e=>e.state,incomplete:e=>e.incomplete,incomplete_reason:e=>e.incomplete_reason,start_utime_us:e=>e.start_utime_us,end_utime_us:e=>e.end_utime_us,payload_kg:e=>e.payload_kg,model_version:e=>e.model_version,battery_j:e=>e.energy.battery_j,measured_j:e=>e.energy.measured_j,measured_s:e=>e.energy.measured_s,modelled_j:e=>e.energy.modelled_j,unexplained_j:e=>e.energy.unexplained_j,drawn_j:e=>e.energy.drawn_j,returned_j:e=>e.energy.returned_j,charge_ah:e=>e.energy.charge_ah,distance_m:e=>e.energy.distance_m,turned_rad:e=>e.energy.turned_rad,duration_s:e=>e.energy.duration_s,samples:e=>e.samples,gap_count:e=>e.gap_count,gap_s:e=>e.gap_s,note:e=>e.note},Se=e=>`${Object.values(Ce).map(t=>function(e){if(null==e)return"";if("string"!=typeof e)return String(e);let t=/^[=+\-@\t\r]/.test(e)?`'${e}`:e;return/[",\r\n]/.test(t)?`"${t.replaceAll('"','""')}"`:t}(t(e))).join(",")}\r\n`,Ne=e=>e?1e3*new Date(e).getTime():void 0;function Pe(e){return{robot_id:e.robot,mission_id:e.name,state:e.state,incomplete:e.incomplete,from_utime_us:Ne(e.from),to_utime_us:Ne(e.to),payload_min_kg:e.payload_min,payload_max_kg:e.payload_max}}var Ee=({measured_j:e,modelled_j:t})=>null!==e&&0!==t?e/t:null;function Oe({missions:e,with_robot:t=!0}){return Q`<table class="grid missions">
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
<td class="figure">${V(e.energy.duration_s)}</td>
<td class="figure"><${$} of=${U(e.energy.distance_m)} /></td>
<td class="figure wide"><${$} of=${H(e.payload_kg,"kg")} /></td>
<td class="figure"><${$} of=${I(e.energy.battery_j)} /></td>
<td class="figure wide"><${$} of=${I(e.energy.modelled_j)} /></td>
<td class="figure"><${De} value=${Ee(e.energy)} /></td>
<td class="figure wide"><${$} of=${e.energy.distance_m>.1?H(e.energy.battery_j/e.energy.distance_m,"J/m"):H(null)} /></td>
</tr>`)}</tbody>
</table>`}function De({value:e}){return Q`<span class=${z(e)&&Math.abs(e-1)>.1?"ratio off":"ratio"}>${F(e,3)}</span>`}function Ae({given:e,change:t}){let a=[...s().robots.keys()].sort(),n=a=>n=>t({...e,[a]:n.currentTarget.value}),l=(e,t)=>Q`<label class="field"><span>${e}</span>${t}</label>`,r=Object.values(e).some(e=>""!==e&&void 0!==e);return Q`<form class="filters" aria-label="Filter missions" onSubmit=${e=>e.preventDefault()}>
${l("Robot",Q`<select value=${e.robot??""} onChange=${n("robot")}><option value="">all</option>
${e.robot&&!a.includes(e.robot)&&Q`<option value=${e.robot}>${e.robot}</option>`}
${a.map(e=>Q`<option key=${e} value=${e}>${e}</option>`)}</select>`)}
${l("From",Q`<input type="datetime-local" value=${e.from??""} onChange=${n("from")} />`)}
${l("To",Q`<input type="datetime-local" value=${e.to??""} onChange=${n("to")} />`)}
<fieldset class="field"><legend>Payload, kg</legend><span class="with-unit">
<input class="short" type="number" min="0" step="any" aria-label="Payload, from kg" placeholder="from" value=${e.payload_min??""} onChange=${n("payload_min")} />
<input class="short" type="number" min="0" step="any" aria-label="Payload, to kg" placeholder="to" value=${e.payload_max??""} onChange=${n("payload_max")} /></span></fieldset>
${l("State",Q`<select value=${e.state??""} onChange=${n("state")}><option value="">all</option>${y.map(e=>Q`<option key=${e} value=${e}>${e}</option>`)}</select>`)}
${l("Measured",Q`<select value=${e.incomplete??""} onChange=${n("incomplete")}><option value="">all</option><option value="false">complete</option><option value="true">incomplete</option></select>`)}
${l("Named",Q`<input type="text" value=${e.name??""} onChange=${n("name")} />`)}
<button type="button" class="plain" disabled=${!r} onClick=${()=>t({})}>Clear</button>
</form>`}function Le({told:e}){return Q`<${_} of=${e} what="totals">${e=>{let t=e.energy,a=e.missions>0;return Q`<dl class="readouts">
<${m} label="Missions" of=${F(e.missions)} note=${e.incomplete_missions>0?`${F(e.incomplete_missions)} incomplete`:""} />
<${m} label="Energy from the batteries" of=${I(a?t.battery_j:null)} channel="measured" />
<${m} label="Modelled" of=${I(a?t.modelled_j:null)} channel="modelled" />
<${m} label="Unexplained" of=${I(t.unexplained_j)} channel="gap" note=${null!==t.unexplained_j&&0!==t.battery_j?`${F(100*t.unexplained_j/t.battery_j,1)} %`:""} />
<${m} label="Distance" of=${U(t.distance_m)} />
<${m} label="Per metre" of=${H(t.distance_m>0?t.battery_j/t.distance_m:null,"J/m")} />
<${m} label="Driving" of=${V(t.duration_s)} />
</dl>`}}<//>`}function Re({given:t,total:a}){let[n,s]=E(null),[l,r]=E(null),o=L(null);D(()=>()=>o.current?.abort(),[]);let i=async a=>{o.current=new AbortController,r(null),s(0);try{await async function(t,a,n,s){let l,r=["csv"===t?`${Object.keys(Ce).join(",")}\r\n`:"[\n"],o=0;do{let i=await ee(`/v1/missions${e({...a,limit:1e3,cursor:l})}`,s);i.missions.length>0&&("csv"===t?r.push(i.missions.map(Se).join("")):r.push((o>0?",\n":"")+i.missions.map(e=>JSON.stringify(e)).join(",\n"))),o+=i.missions.length,l=i.next_cursor,n(o)}while(null!==l);"json"===t&&r.push("\n]\n"),function(e,t,a){let n=URL.createObjectURL(new Blob(e,{type:a})),s=Object.assign(document.createElement("a"),{href:n,download:t});document.body.append(s),s.click(),s.remove(),setTimeout(()=>URL.revokeObjectURL(n),6e4)}(r,`joulecast-missions-${(new Date).toISOString().slice(0,19).replaceAll(":","")}.${t}`,"csv"===t?"text/csv":"application/json")}(a,Pe(t),s,o.current.signal)}catch(e){"AbortError"!==e.name&&r(e)}s(null)};return null!==n?Q`<div class="export" role="status">
<progress max=${a||1} value=${n}></progress> ${F(n)} of ${F(a)}
<button type="button" onClick=${()=>o.current.abort()}>Stop</button></div>`:Q`<div class="export">${l&&Q`<span class="fault" role="alert">${l.message}</span>`}
<button type="button" disabled=${!a} onClick=${()=>i("csv")}>Export CSV</button>
<button type="button" disabled=${!a} onClick=${()=>i("json")}>Export JSON</button></div>`}function ze({model:e}){return Q`<details class="model"><summary>Parameters in force</summary>
<table class="facts"><tbody>${Object.entries(O(e)).filter(([e])=>"robot_id"!==e).map(([e,t])=>Q`<tr key=${e}><th scope="row"><code>${e}</code></th><td>${t}</td></tr>`)}</tbody></table></details>`}function Fe({entry:e}){let t=e.state.mission?.id,n=a(t?`/v1/missions/${t}/trace?points=600`:null),[s]=E({mission:null,rows:[]});s.mission!==t&&Object.assign(s,{mission:t,rows:[]});let l=e.path.last(),r=[...t&&n.value&&n.value.id===t?n.value.x_m.map((e,t)=>[e??NaN,n.value.y_m[t]??NaN,n.value.measured_power_w.mean[t]??n.value.modelled_power_w.mean[t]??NaN]):[],...l.map(([e,t,,a])=>[e,t,a])],[o,i,d]=e.state.pose;return 0===r.length||null===o?Q`<${p} title="No position">This robot does not tell where it is.<//>`:Q`<${je} points=${r} height=${340} ends=${!1} robot=${[o,i,d??0]} label=${`Path of ${e.id} so far, coloured by power, and where it is now`} />`}function We({rows:e,label:t}){let a=Math.max(...e.map(e=>e.value??0),1e-9);return Q`<table class="bars" aria-label=${t}><tbody>${e.map(e=>Q`<tr key=${e.name}>
<th scope="row">${e.name}</th>
<td class="bar-cell"><svg width="100%" height="18" aria-hidden="true" focusable="false"><rect class=${`account ${e.channel}`} x="0" y="3" height="12" width=${100*Math.max(0,e.value??0)/a+"%"} /></svg></td>
<td class="figure"><${$} of=${e.of} /></td>
<td class="note">${e.note}</td></tr>`)}</tbody></table>`}var Be={accessories:"Idle and accessories",driver:"Motor drivers",copper:"Copper",brush:"Brushes",friction_internal:"Friction in motors and gears",friction_rolling:"Rolling",friction_scrub:"Scrub in turns",friction_zone:"Floor zones",friction_slip:"Wheel slip",drag:"Air",kinetic:"Change of motion",potential:"Change of height",braking:"Generated in braking",recovered:"Recovered",sensor:"Sensor fault",unexplained:"Unexplained"};function Ie({terms_j:e,battery_j:t,closure:a,measured:n=!0}){let{rows:s,sum:l,absent:r}=function(e,t){let a=e=>Math.abs(e)<=1e-5*Math.abs(t),n=[],s=0;for(let[t,l]of Object.entries(e)){let e="recovered"===t?-l:l;"unexplained"===t&&n.push({key:"modelled",name:"Modelled",from:0,to:s,total:!0}),a(l)&&"unexplained"!==t||n.push({key:t,name:Be[t]??Z(t),from:s,to:s+e,change:e}),s+=e}return{rows:n,sum:s,absent:Object.entries(e).filter(([e,t])=>a(t)&&"unexplained"!==e).map(([e])=>(Be[e]??e).toLowerCase())}}(e,t),o=n?s:s.filter(e=>"unexplained"!==e.key&&"modelled"!==e.key),i=o.flatMap(e=>[e.from,e.to]).concat(t,0),d=Math.min(...i),u=Math.max(...i),c=Math.max(u-d,1e-9),h=e=>(e-d)/c*100,m=[...o,{key:"battery",name:n?"From the battery":"Total",from:0,to:t,total:!0}];return Q`<div class="waterfall">
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
<td class="figure"><${$} of=${I(a)} sign=${!e.total} /></td>
<td class="figure share">${0!==t?F(100*a/t,1):"–"}${" "}%</td>
</tr>`})}
</tbody>
</table>
<p class="closing">
Accounts add up to <b>${F(l,2)}${" "}J</b>; the battery gave <b>${F(t,2)}${" "}J</b>.
${void 0!==a&&Q` ${a<1e-9?"Closes":"Does not close"}: difference ${0===a?"none":a.toExponential(1)} of the whole.`}
${r.length>0&&Q` <span class="note">Next to nothing in: ${r.join(", ")}.</span>`}
</p>
</div>`}var Je=(e,t)=>t.map(e=>{if(null===e)return"";let t=e<0?"−":"",a=Math.abs(e),n=e=>String(Math.floor(e)).padStart(2,"0");return a<3600?`${t}${Math.floor(a/60)}:${n(a%60)}`:`${t}${Math.floor(a/3600)}:${n(a%3600/60)}:${n(a%60)}`});function Ue({trace:e,mission:t,zoom:a,set_zoom:n,set_cursor:s}){let[l,r]=R(()=>{let a=(...a)=>function(e,t,a){let n=function(e,t){return e.start_utime_us.map(a=>(a-t+e.width_us/2)/1e6)}(e,t),s=[];for(let t=1;t<n.length;++t)e.start_utime_us[t]-e.start_utime_us[t-1]>1.9*e.width_us&&s.push(t);if(0===s.length)return[n,...a];let l=(e,t)=>{let a=[];return e.forEach((n,l)=>{s.includes(l)&&a.push(void 0===t?(e[l-1]+n)/2:t),a.push(n)}),a};return[l(n),...a.map(e=>l(e,null))]}(e,t.start_utime_us,a.flatMap(e=>[e.max,e.min,e.mean]));return[a(e.measured_power_w,e.modelled_power_w),a(e.speed_m_s)]},[e]),o=L(e);o.current=e;let d={setCursor:[e=>s(null===e.cursor.idx||void 0===e.cursor.idx?null:He(o.current,t.start_utime_us+1e6*e.data[0][e.cursor.idx]))],setSelect:[e=>{e.select.width<6||(n([e.posToVal(e.select.left,"x"),e.posToVal(e.select.left+e.select.width,"x")]),e.setSelect({left:0,top:0,width:0,height:0},!1))}]},u={...P("mission"),drag:{x:!0,y:!1,setScale:!1,dist:6},bind:{dblclick:()=>()=>n(null)}},c=e=>M(e,{size:26,values:Je}),h=L([]),$=L(0);return Q`<div class="charts" tabindex="0" role="group" aria-label="Power and speed over time. Left and right move the cursor, plus looks closer, minus shows the whole mission." onKeyDown=${e=>{let t=h.current[0].data[0],a=Math.max(1,Math.round(t.length/20)),s=e.shiftKey?a:1,l={ArrowLeft:$.current-s,ArrowRight:$.current+s,Home:0,End:t.length-1}[e.key],r=t[t.length-1]-t[0],o=t[Math.min($.current,t.length-1)];if(void 0!==l){$.current=Math.max(0,Math.min(t.length-1,l));for(let e of h.current)e.setCursor({left:e.valToPos(t[$.current],"x"),top:8})}else if("+"===e.key&&r>4)n([Math.max(t[0],o-r/4),Math.min(t[t.length-1],o+r/4)]);else{if("-"!==e.key&&"Escape"!==e.key)return;n(null)}e.preventDefault()}}>
<${T} make=${()=>{let e=i(),t={show:!0,stroke:"transparent",points:{show:!1}};return{cursor:u,hooks:d,scales:{x:{time:!1}},axes:[c(""),M("power, W")],bands:[{series:[1,2],fill:S(e.measured,.2)},{series:[4,5],fill:S(e.modelled,.16)}],series:[{},t,t,{stroke:e.measured,width:1.75,points:{show:!1}},t,t,{stroke:e.modelled,width:1.5,points:{show:!1}}]}}} data=${l} height=${270} changes=${[t.id]} onReady=${e=>{h.current[0]=e}} label="Battery power over the mission, measured and modelled, with the least and greatest of each span" />
<${T} make=${()=>{let e=i(),t={stroke:"transparent",points:{show:!1}};return{cursor:u,hooks:d,scales:{x:{time:!1}},axes:[c("time since the start"),M("speed, m/s")],bands:[{series:[1,2],fill:S(e.ink,.12)}],series:[{},t,t,{stroke:e.ink,width:1.5,points:{show:!1}}]}}} data=${r} height=${150} changes=${[t.id]} onReady=${e=>{h.current[1]=e}} label="Speed over the mission" /></div>`}function Ge({trace:e,mission:t,index:a}){let n=null!==a&&a<e.start_utime_us.length?a:null,s=(e,t)=>null===n?{n:"–",u:""}:t(e[n]),l=e.measured_power_w,r=e.modelled_power_w,o=null===n||null===l.mean[n]?null:l.mean[n]-r.mean[n];return Q`<dl class="readouts strip" aria-live="off">
<${m} label="Time" of=${null===n?"–":V((e.start_utime_us[n]-t.start_utime_us)/1e6)} />
<${m} label="Measured" channel="measured" of=${s(l.mean,J)} note=${null!==n&&null!==l.mean[n]?`${F(l.min[n],0)} to ${F(l.max[n],0)}`:""} />
<${m} label="Modelled" channel="modelled" of=${s(r.mean,J)} />
<${m} label="Gap" channel="gap" of=${(()=>{let e=J(o);return{n:B(e.n),u:e.u}})()} />
<${m} label="Speed" of=${s(e.speed_m_s.mean,e=>H(e,"m/s",2))} />
<${m} label="Charge" of=${s(e.state_of_charge,e=>G(e,2))} />
</dl>`}function He(e,t){let a=Math.floor((t-e.start_utime_us[0])/e.width_us),n=Math.max(0,Math.min(a,e.start_utime_us.length-1));for(;n>0&&e.start_utime_us[n]>t;)n-=1;return n}function qe({mission:t,whole:n,fine:s}){let[l,r]=E(null),[o,i]=E(null),[d,u]=E("power"),c=e=>Math.round(t.start_utime_us+1e6*e),h=a(null===l?null:`/v1/missions/${t.id}/trace${e({points:700,from_utime_us:c(l[0]),to_utime_us:c(l[1])})}`),$=null!==l&&null!==h.value&&h.value.start_utime_us.length>1?h.value:n,m=n.measured_power_w.mean.some(e=>null!==e),g=$===n?s:$,f=R(()=>g.x_m.map((e,t)=>{let a=g.measured_power_w.mean[t],n=g.modelled_power_w.mean[t];return[e??NaN,g.y_m[t]??NaN,"gap"===d?null===a?NaN:a-n:a??n??NaN]}),[g,d]),_=null===o||o>=$.start_utime_us.length?null:He(g,$.start_utime_us[o]+$.width_us/2),y=f.some(([e])=>Number.isFinite(e));return 0===n.start_utime_us.length?Q`<${b} title="Power"><${p} title="No trace kept">The mission ended before its first sample was stored.<//><//>`:Q`<div class="columns trace-columns">
<${b} class="screen" title="Power and speed" aside=${Q`
<span class="key"><span class="swatch measured"></span>measured <span class="swatch modelled"></span>modelled <span class="swatch band"></span>least to greatest</span>
${null===l?Q`<span class="note">drag or press + to look closer</span>`:Q`<button type="button" onClick=${()=>r(null)}>Whole mission</button>`}`}>
<${Ue} trace=${$} mission=${t} zoom=${l} set_zoom=${r} set_cursor=${i} />
<${Ge} trace=${$} mission=${t} index=${o} />
<p class="note foot">Each point is ${V($.width_us/1e6)}${null!==l?", closer view":""}.</p>
<//>
<${b} class="screen" title="On the floor" aside=${Q`<${v} label="Colour by" value=${d} onChange=${u} options=${m?[["power","Power"],["gap","Gap"]]:[["power","Power"]]} />`}>
${y?Q`<${je} points=${f} kind=${d} cursor=${_} height=${440} label=${`Path of the mission, coloured by ${"gap"===d?"measured minus modelled power":"power"}; circle: start, square: end`} />
<p class="note foot">○ start  ■ end. Poses as the robot told them.</p>`:Q`<${p} title="No poses">This robot did not tell where it was.<//>`}
<//>
</div>`}function Ve({mission:e,trace:n}){let s=a(`/v1/robots/${t(e.robot_id)}`),l=s.value?.model.idle_power_w,r=R(()=>void 0===l?null:function(e,t,a){let{distance_m:n,duration_s:s}=e.energy,{runs:l,stood_at_end_s:r}=function(e,t){let a=[],n=null,s=null,l=0;return e.speed_m_s.mean.forEach((r,o)=>{let i=Math.abs(r??0),[d,u]=[e.x_m[o],e.y_m[o]],c=e.covered_s[o]??0;if(i<=.02?(n=null,e.modelled_power_w.mean[o]<=1.05*t&&(l+=c)):(null===n&&(a.push(n={length_m:0,stood_s:l,first:NaN,last:NaN}),l=0),n.length_m+=i*c),null===d||null===u||(null===s&&(s=[d,u]),Math.hypot(d-s[0],u-s[1])<.05))return;let h=Math.atan2(u-s[1],d-s[0]),$=n??a[a.length-1];void 0!==$&&(Number.isNaN($.first)&&($.first=h),$.last=h),s=[d,u]}),{runs:a.filter(({length_m:e})=>e>=.05),stood_at_end_s:l}}(t,a);if(0===l.length||l.length>400||n<.05)return null;let o=l.reduce((e,t)=>e+t.length_m,0),i=e=>e>.2?[{kind:"dwell",duration_s:e}]:[];return{path:[...l.flatMap((e,t)=>{let a=0===t?NaN:function(e,t){let a=t-e;return Math.atan2(Math.sin(a),Math.cos(a))}(l[t-1].last,e.first);return[...i(e.stood_s),...Math.abs(a)>.02?[{kind:"turn",angle_rad:a}]:[],{kind:"straight",length_m:e.length_m/o*n}]}),...i(r)],payload_kg:e.payload_kg??0,deadline_s:s,columns:!1}}(e,n,l),[e.id,e.state,l]),[o,i]=E({value:null,error:null});D(()=>{if(null===r)return;let a=new AbortController;return te(`/v1/robots/${t(e.robot_id)}/profile`,r,a.signal).then(e=>i({value:e,error:null}),e=>"AbortError"===e.name||i({value:null,error:e})),()=>a.abort()},[r]);let d=null===s.value?s.error:o.error;if(null!==d)return Q`<${f} error=${d} />`;if(null!==s.value&&null===r)return Q`<${p} title="Nothing to compare">The robot did not drive, or in too many short runs.<//>`;if(null===o.value)return Q`<${g} what="the minimum-energy drive" />`;let u=e.energy,c=o.value,h=1-c.energy_j/u.modelled_j,$=r.path.reduce((e,t)=>e+Math.abs(t.angle_rad??0),0),m=r.path.reduce((e,t)=>e+(t.duration_s??0),0),_=r.path.filter(e=>"straight"===e.kind).length;return Q`
<p class="verdict">${h>.005?Q`The same legs could have been driven for <b>${F(100*h,1)}${" "}%</b> less.`:h>-.005?"Driven about as cheaply as the model allows.":"Driven for less than these legs cost from stop to stop: the robot turned while it drove."}</p>
<${We} label="Energy of the mission and of the minimum-energy drive" rows=${[{name:"Measured",value:u.measured_j,of:I(u.measured_j),channel:"measured",note:V(u.duration_s)},{name:"Modelled",value:u.modelled_j,of:I(u.modelled_j),channel:"modelled",note:V(u.duration_s)},{name:"Least energy",value:c.energy_j,of:I(c.energy_j),channel:"least",note:V(c.duration_s)}]} />
<p class="note foot">${_} ${1===_?"leg":"legs"} between stops, ${q(U(u.distance_m))} in all, ${F(180*$/Math.PI)}° turned at the stops,${m>0?` ${V(m)} standing as the mission did,`:""}${" "}payload ${q(H(e.payload_kg??0,"kg"))}, arriving no later. Model version ${c.model_version}; the saving is against the modelled energy, so that a gap of the model does not count as one.</p>`}function Ke({mission:e}){let t=Object.entries(e.sample_faults),a=(e,t)=>Q`<tr><th scope="row">${e}</th><td>${t}</td></tr>`,n=e.energy;return Q`<table class="facts"><tbody>
${a("Robot",Q`<a href=${u(e.robot_id)}>${e.robot_id}</a>`)}
${a("Started",X(e.start_utime_us))}
${a("open"===e.state?"Last heard":"Ended",X(e.end_utime_us))}
${a("Announced",e.implicit?"no: opened by its telemetry":"by the robot")}
${a("Model",null===e.model_version?"none":`version ${e.model_version}`)}
${a("Samples",F(e.samples))}
${a("Gaps",0===e.gap_count?"none":`${e.gap_count}, ${V(e.gap_s)} in all`)}
${a("Faulty samples",0===t.length?"none":t.map(([e,t])=>`${t} ${Z(e)}`).join(", "))}
${a("Battery measured",`${V(n.measured_s)} of ${V(n.duration_s)}`)}
${a("Drawn · returned",`${q(I(n.drawn_j))} · ${q(I(n.returned_j))}`)}
${a("Charge",q(H(1e3*n.charge_ah,"mAh")))}
${a("Motors measured",null===n.measured_motor_j[0]?"–":`right ${q(I(n.measured_motor_j[0]))}, left ${q(I(n.measured_motor_j[1]))}`)}
${a("Motors modelled",`right ${q(I(n.modelled_motor_j[0]))}, left ${q(I(n.modelled_motor_j[1]))}`)}
${e.note&&a("Note",e.note)}
</tbody></table>`}var Xe=Math.PI/180,Ye={straight:{name:"Straight",fields:{length:{label:"length",unit:"m",min:.01,start:5}}},turn:{name:"Turn in place",fields:{angle:{label:"angle, left positive",unit:"°",start:90}}},arc:{name:"Arc",fields:{radius:{label:"radius",unit:"m",min:.01,start:2},angle:{label:"angle, left positive",unit:"°",start:90}}},dwell:{name:"Dwell",fields:{duration:{label:"time",unit:"s",min:0,start:10}}},payload:{name:"Payload from here",fields:{mass:{label:"payload",unit:"kg",min:0,start:10}}}};function Ze(e){return{kind:e,...Object.fromEntries(Object.entries(Ye[e].fields).map(([e,t])=>[e,t.start]))}}function Qe(e){switch(e.kind){case"turn":return{kind:"turn",angle_rad:e.angle*Xe};case"arc":return{kind:"arc",radius_m:e.radius,angle_rad:e.angle*Xe};case"dwell":return{kind:"dwell",duration_s:e.duration};case"payload":return{kind:"payload",payload_kg:e.mass};default:return{kind:"straight",length_m:e.length}}}function et(e){let[[t,a],n]=e;return{start_pose:{x_m:t,y_m:a,heading_rad:Math.atan2(n[1]-a,n[0]-t)},path:[{kind:"polyline",points:e.slice(1).map(([e,t])=>({x_m:e,y_m:t}))}]}}var tt=.25,at=e=>Math.round(e/tt)*tt;function nt({points:e,change:t,height:a=400}){let[n,s]=E(16),[l,r]=E(null),o=L(null),d=L(null),u=e=>{let t=e.currentTarget.getBoundingClientRect();return[e.clientX-t.left,e.clientY-t.top]},c=e=>d.current.from(...e).map(at),h=a=>{let n=e[e.length-1];(!n||n[0]!==a[0]||n[1]!==a[1])&&t([...e,a])},$=()=>{o.current=null};return Q`<div class="draw">
<${Me} draw=${(t,a,s)=>{let r=d.current=ve(a/n,0,0,a,s),o=i();if(we(t,r),t.strokeStyle=t.fillStyle=o.accent,t.lineWidth=3,t.lineJoin="round",t.beginPath(),e.forEach(([e,a],n)=>t[0===n?"moveTo":"lineTo"](...r.to(e,a))),t.stroke(),e.forEach(([a,n],s)=>{t.beginPath(),t.arc(...r.to(a,n),5,0,7),t.fillStyle=s===e.length-1?o.accent:o.screen,t.fill(),t.stroke()}),e.length>0&&xe(t,r,e[0][0],e[0][1],e.length>1?Math.atan2(e[1][1]-e[0][1],e[1][0]-e[0][0]):0,o.ink),l){let[e,a]=r.to(...l);t.strokeStyle=o.ink,t.lineWidth=1,t.beginPath(),t.moveTo(e-12,a),t.lineTo(e+12,a),t.moveTo(e,a-12),t.lineTo(e,a+12),t.stroke()}ke(t,r)}} height=${a} changes=${[e,n,l]} role="application" tabindex="0"
label=${`Drawing of the path, ${e.length} points. Arrow keys move the cross, Enter adds a point, Backspace removes the last.${l?` Cross at ${W(l[0],3)}, ${W(l[1],3)} metres.`:""}`}
onPointerDown=${t=>{let a=u(t),n=(([t,a])=>e.findIndex(([e,n])=>{let[s,l]=d.current.to(e,n);return Math.hypot(t-s,a-l)<12}))(a);t.currentTarget.setPointerCapture(t.pointerId),n>=0?o.current=n:(h(c(a)),o.current=e.length)}} onPointerMove=${a=>{if(null===o.current)return;let n=c(u(a)),s=e[o.current];s&&(s[0]!==n[0]||s[1]!==n[1])&&t(e.map((e,t)=>t===o.current?n:e))}} onPointerUp=${$} onPointerCancel=${$} onKeyDown=${a=>{let n=a.shiftKey?1:tt,s={ArrowLeft:[-n,0],ArrowRight:[n,0],ArrowUp:[0,n],ArrowDown:[0,-n]}[a.key],o=l??e[e.length-1]??[0,0];if(s)r([o[0]+s[0],o[1]+s[1]]);else if("Enter"===a.key)h(o);else{if("Backspace"!==a.key&&"Delete"!==a.key)return;t(e.slice(0,-1))}a.preventDefault()}} />
<div class="tools"><button type="button" onClick=${()=>t(e.slice(0,-1))} disabled=${0===e.length}>Undo point</button>
<button type="button" onClick=${()=>t([])} disabled=${0===e.length}>Clear</button>
<button type="button" onClick=${()=>s(n/2)} disabled=${n<=4} aria-label="Closer">+</button>
<button type="button" onClick=${()=>s(2*n)} disabled=${n>=256} aria-label="Wider">−</button>
<span class="note">Press to add, drag to move; snaps to ${tt} m. Corners are turned in place.</span></div>
</div>`}var st=()=>[{kind:"straight",length:6},{kind:"turn",angle:90},{kind:"straight",length:4}];function lt({legs:e,change:t,fault:a}){let n=(a,n)=>{let s=[...e];[s[a],s[a+n]]=[s[a+n],s[a]],t(s)};return Q`<fieldset class="legs"><legend>Legs</legend><ol>
${e.map((s,l)=>Q`<li key=${l} class=${a===l?"faulty":""}>
<select aria-label=${`Kind of leg ${l+1}`} value=${s.kind} onChange=${a=>t(e.map((e,t)=>t===l?Ze(a.currentTarget.value):e))}>
${Object.entries(Ye).map(([e,{name:t}])=>Q`<option key=${e} value=${e}>${t}</option>`)}</select>
<span class="leg-fields">${Object.entries(Ye[s.kind].fields).map(([a,n])=>Q`<label key=${a} class="inline"><span class="hidden">${`Leg ${l+1}, ${n.label}`}</span>
<input type="number" step="any" min=${n.min} required title=${n.label} value=${s[a]} onInput=${n=>((a,n)=>t(e.map((e,t)=>t===a?{...e,...n}:e)))(l,{[a]:n.currentTarget.valueAsNumber})} /><span class="unit">${n.unit}</span></label>`)}</span>
<span class="leg-tools"><button type="button" class="plain" disabled=${0===l} aria-label=${`Move leg ${l+1} up`} onClick=${()=>n(l,-1)}>↑</button>
<button type="button" class="plain" disabled=${l===e.length-1} aria-label=${`Move leg ${l+1} down`} onClick=${()=>n(l,1)}>↓</button>
<button type="button" class="plain" disabled=${1===e.length} aria-label=${`Remove leg ${l+1}`} onClick=${()=>t(e.filter((e,t)=>t!==l))}>×</button></span></li>`)}
</ol><button type="button" onClick=${()=>t([...e,Ze("straight")])}>Add a leg</button></fieldset>`}function rt(e,t,a){if(!t)return e.map(()=>null);let n=t.time_s,s=t[a],l=1;return e.map(e=>{for(;l<n.length-1&&n[l]<e;)l+=1;let t=n[l]>n[l-1]?Math.max(0,Math.min(1,(e-n[l-1])/(n[l]-n[l-1]))):1;return s[l-1]+t*(s[l]-s[l-1])})}function ot({answer:e}){let t=e.profile,a=t.yaw_rate_rad_s.some(e=>Math.abs(e)>1e-6),{trapezoid:n,triangle:s}=e.baselines,l=R(()=>[t.time_s,t.speed_m_s,rt(t.time_s,n?.profile,"speed_m_s"),rt(t.time_s,s?.profile,"speed_m_s"),a?t.yaw_rate_rad_s:t.time_s.map(()=>null)],[e]),r=R(()=>[t.time_s,t.power_w],[e]),o={sync:{key:"plan"},drag:{x:!1,y:!1}};return Q`
<${T} make=${()=>{let e=i(),t={show:!1};return{cursor:o,scales:{x:{time:!1},yaw:{}},axes:[M("",{size:28}),M("speed, m/s"),...a?[M("yaw rate, rad/s",{scale:"yaw",side:1,grid:{show:!1}})]:[]],series:[{},{stroke:e.accent,width:2.25,points:t},{stroke:e.muted,width:1.25,dash:[6,4],points:t},{stroke:e.muted,width:1.25,dash:[2,3],points:t},{stroke:e.modelled,width:1.25,scale:a?"yaw":"y",points:t}]}}} data=${l} height=${210} changes=${[a]} label=${`Speed over ${V(e.duration_s)}, greatest ${F(e.peak_speed_m_s,2)} metres a second`} />
<${T} make=${()=>{let e=i();return{cursor:o,scales:{x:{time:!1}},axes:[M("time, s",{size:28}),M("power, W"),...a?[M(" ",{scale:"y",side:1,grid:{show:!1},ticks:{show:!1},values:()=>[]})]:[]],series:[{},{stroke:e.accent,width:1.75,fill:S(e.accent,.12),points:{show:!1}}]}}} data=${r} height=${150} changes=${[a]} label="Battery power of the optimal profile over time" />
<p class="note foot"><span class="swatch accent"></span>least energy ${a&&Q`<span class="swatch modelled"></span>yaw rate `}<span class="swatch dashed"></span>trapezoid <span class="swatch dotted"></span>triangle</p>`}function it({answer:e,take:t}){let a=e.pareto,{trapezoid:n,triangle:s}=e.baselines,l=R(()=>{let t=[a,[e],[n],[s]].map(e=>new Map(e.filter(Boolean).map(e=>[e.duration_s,e.energy_j]))),l=[...new Set(t.flatMap(e=>[...e.keys()]))].sort((e,t)=>e-t);return[l,...t.map(e=>l.map(t=>e.get(t)??null))]},[e]),[r,o]=E(0),d=a[Math.min(r,a.length-1)];return Q`<${T} make=${()=>{let e=i(),t=(e,t,a)=>({stroke:"transparent",paths:()=>null,points:{show:!0,size:t,width:2,stroke:e,fill:a}});return{scales:{x:{time:!1}},cursor:{y:!1,drag:{x:!1,y:!1},points:{show:!1}},axes:[M("duration, s",{size:28,space:70}),M("energy, J",{size:58})],series:[{},{stroke:e.modelled,width:1.5,spanGaps:!0,points:{show:!0,size:5,fill:e.modelled}},t(e.accent,12,e.accent),t(e.muted,9,e.screen),t(e.muted,9,e.muted)]}}} data=${l} height=${230} changes=${[]} label=${`Energy against duration, from ${V(a[0].duration_s)} to ${V(a[a.length-1].duration_s)}`} />
<p class="note foot"><span class="swatch accent dot"></span>this plan <span class="swatch hollow dot grey"></span>trapezoid <span class="swatch grey dot"></span>triangle <span class="swatch modelled"></span>front</p>
<div class="front-pick"><label><span>Walk the front</span><input type="range" min="0" max=${a.length-1} value=${r} onInput=${e=>o(e.currentTarget.valueAsNumber)} aria-valuetext=${`${V(d.duration_s)}, ${q(I(d.energy_j))}`} /></label>
<span class="number">${F(d.duration_s,1)} s · ${q(I(d.energy_j))}; a second less costs ${dt(d.time_multiplier_w)}</span>
<button type="button" onClick=${()=>t(d)}>Take as deadline</button></div>`}var dt=e=>0!==e&&Math.abs(e)<.005?"less than 0.01 J":q(I(e)),ut={closed_form:"formulas",interior_point:"an interior-point method",mixed:"formulas and an interior-point method"};function ct(e){if(!e)return"not possible here";let t=e.saving_fraction,a=q(G(Math.abs(t),1));return e.within_limits?t>=0?`we save ${a}`:`costs ${a} less`:`breaks the limits, and costs ${a} ${t>=0?"more":"less"}`}function ht({answer:e}){let t=e.certificate,a=(e,t)=>Q`<tr><th scope="row">${e}</th><td>${t}</td></tr>`;return Q`<table class="facts"><tbody>
${a("Found by",ut[t.method]??Z(t.method))}
${a("At most above the optimum",dt(t.gap_j))}
${a("Error of the time steps",dt(t.discretisation_j))}
${a("A global optimum",t.convex?"yes: the problem is convex":"not proven: the problem is not convex")}
${a("A second less costs",dt(t.time_multiplier_w))}
${a("Limits met",0===t.binding.length?"none":t.binding.map(Z).join(", "))}
${a("Braking",`${q(I(e.braking_j))}, of which ${q(I(e.recovered_j))} returns`)}
${a("Peak power",q(J(e.peak_power_w)))}
${a("Model",`version ${e.model_version}`)}
</tbody></table>`}function $t({answer:e,autonomy:t}){if(null!==t.error)return Q`<${f} error=${t.error} />`;if(null===t.value)return Q`<p class="verdict open">The robot has not told its charge: enter it to see whether the robot makes it.</p>`;let a=t.value,n=a.usable_energy_j-e.energy_j,s=n>=0,l=a.state_of_charge-a.reserve_fraction,r=l>0?a.state_of_charge-l*e.energy_j/a.usable_energy_j:null,o=e.energy_j>0?Math.floor(a.usable_energy_j/e.energy_j):null;return Q`<div class=${"verdict-box "+(s?"makes":"fails")}>
<p class="verdict"><b>${s?"The robot makes it":"The robot does not make it"}</b>${s?Q`: arrives with ${q(G(r,r>.995?2:1))} charge, ${q(I(n))} above its reserve of ${q(G(a.reserve_fraction))}.`:Q`: ${q(I(-n))} short of its reserve of ${q(G(a.reserve_fraction))}.`}</p>
<p class="note">Starts with ${q(G(a.state_of_charge,1))}, ${q(I(a.usable_energy_j))} usable${o>=2?`: ${F(o)} such drives`:""}. At its ${"model"===a.consumption.basis?"modelled":"recent"} consumption it has ${q(U(a.range_m))} or ${V(a.run_time_s)} left.</p></div>`}var mt={fleet:function(){x("Fleet");let e=s(),t=o(),a=ne(),[n,l]=E(""),[r,i]=E("all"),[d,u]=E({key:"robot",down:!1}),[c,h]=E(!1),$=[...e.robots.values()].filter(e=>de(e.state)).length,m="all"===r&&""===n&&$>0&&$<e.robots.size,_=function(e,t,a,n){let s=L({key:"",at:-1/0,rows:[]}),l=`${t}|${a}|${n.key}|${n.down}|${e.robots.size}|${e.loads}`,r=performance.now();if(s.current.key!==l||r-s.current.at>3e3){let o=ie.find(e=>e.key===n.key),i=function(e,t,a){let n=t.trim().toLowerCase(),s={all:()=>!0,heard:e=>!de(e),live:e=>e.live,charging:e=>null!==e.charging,silent:e=>!e.live,mission:e=>null!==e.mission,low:e=>null!==e.state_of_charge&&e.state_of_charge<.25}[a];return[...e.values()].filter(e=>s(e.state)&&(""===n||e.id.toLowerCase().includes(n)||(e.state.mission?.mission_id??"").toLowerCase().includes(n)))}(e.robots,t,a).sort((e,t)=>de(e.state)-de(t.state)||(n.down?-1:1)*o.sort(e,t)||oe.compare(e.id,t.id));s.current={key:l,at:r,rows:i}}return s.current.rows}(e,n,m&&!c?"heard":r,d),[b,y,w]=function(e){let t=L(null),[a,n]=E([0,40]);return D(()=>{let a=()=>{if(null===t.current)return;let a=t.current.getBoundingClientRect().top,s=Math.max(0,Math.floor(-a/46)-8),l=Math.min(e,Math.ceil((innerHeight-a)/46)+8);n(e=>e[0]===s&&e[1]===l?e:[s,l])};return a(),addEventListener("scroll",a,{passive:!0}),addEventListener("resize",a),()=>{removeEventListener("scroll",a),removeEventListener("resize",a)}},[e]),[t,Math.min(a[0],e),Math.min(Math.max(a[1],0),e)]}(_.length);return e.loaded||0!==e.robots.size?0===e.robots.size?Q`<h1>Fleet</h1><${p} title="No robot yet">A robot appears here when its telemetry arrives over LCM or its file is put to <code>/v1/robots/…</code>.<//>`:Q`
<h1 class="hidden">Fleet</h1>
<${me} robots=${e.robots} />
<div class="tools">
<label class="find"><span class="hidden">Find a robot or mission</span><input type="search" placeholder="Find a robot or mission" value=${n} onInput=${e=>l(e.currentTarget.value)} /></label>
<${v} label="Show" value=${r} onChange=${i} options=${[["all","All"],["live","Live"],["silent","Silent"],["mission","On a mission"],["charging","Charging"],["low","Low charge"]]} />
<span class="key"><span class="swatch measured"></span>measured <span class="swatch modelled"></span>modelled</span>
</div>
<table class="grid fleet" aria-rowcount=${_.length+1}>
<thead><tr>${ie.map(e=>Q`<th key=${e.key} scope="col" class=${e.class} aria-sort=${(e=>e.key!==d.key?void 0:d.down?"descending":"ascending")(e)}>
${e.sort?Q`<button type="button" onClick=${()=>(e=>u(t=>({key:e,down:t.key===e&&!t.down})))(e.key)}>${e.title}<span class="arrow" aria-hidden="true">${e.key===d.key?d.down?"▾":"▴":""}</span></button>`:e.title}</th>`)}</tr></thead>
<tbody ref=${b}>
${y>0&&Q`<tr key="above" aria-hidden="true" class="spacer"><td colspan=${ie.length} style=${{height:46*y+"px"}}></td></tr>`}
${_.slice(y,w).map((e,n)=>Q`<${$e} key=${e.id} entry=${e} revision=${e.revision} index=${y+n} dark=${t} band=${a.get(e.id)?.range} />`)}
${w<_.length&&Q`<tr key="below" aria-hidden="true" class="spacer"><td colspan=${ie.length} style=${{height:46*(_.length-w)+"px"}}></td></tr>`}
</tbody>
</table>
${0===_.length&&Q`<${p} title="No robot matches" />`}
${m&&Q`<p class="fold"><button type="button" class="plain" aria-expanded=${String(c)} onClick=${()=>h(!c)}>${c?"Hide":"Show"} ${$} ${1===$?"robot":"robots"} not heard since the service started</button></p>`}`:null!==e.error?Q`<${f} error=${e.error} />`:Q`<${g} what="the fleet" />`},robots:function({id:n}){x(n);let l=s(),r=o(),i=ne(n).get(n),d=a(`/v1/robots/${t(n)}`),u=a(`/v1/missions${e({robot_id:n,limit:12})}`),h=l.robots.get(n),$=h?.state,g=$?.mission?.id;return D(()=>{null!==u.value&&u.reload()},[g]),!$&&l.loaded&&404===d.error?.status?Q`<${p} title=${`There is no robot ${n}`}>See the <a href="#/fleet">fleet</a>.<//>`:Q`
<div class="heading"><p class="crumbs"><a href="#/fleet">Fleet</a></p><h1>${n}</h1>
${$&&Q`<span class="health"><${ue} state=${$} /></span>`}
<span class="spring"></span><a class="button" href=${`#/plan${e({robot:n})}`}>Plan a drive</a></div>
${$&&Q`<dl class="readouts">
<${m} large label=${null===$.measured_power_w?"Power (modelled)":"Power"} of=${J($.measured_power_w??$.modelled_power_w)} channel=${null===$.measured_power_w?"modelled":"measured"} note=${Q`<${ae} track=${h.power} revision=${h.revision} dark=${r} width=${120} height=${26} />`} />
<${m} large label="Charge" of=${G($.state_of_charge)} note=${[null===$.state_of_charge?"":ce($).text,null===$.battery_voltage_v?"":q(H($.battery_voltage_v,"V",2))].filter(Boolean).join(" · ")} />
<${m} large label="Range" of=${U(i?.range?.p50??$.range_m)} note=${se(i?.range,U)} />
<${m} large label="Run time" of=${K(i?.time?.p50??$.run_time_s)} note=${se(i?.time,e=>({n:K(e),u:""}))} />
${null===$.charging&&z($.charge.time_to_charged_s)&&Q`<${m} large label="To charge" of=${K($.charge.time_to_charged_s)} note="if it went now" />`}
<${m} large label="Speed" of=${H($.speed_m_s,"m/s",2)} />
<${m} large label="Payload" of=${H($.payload_kg,"kg")} />
<${m} large label="Windings, right · left" of=${null===$.winding_temperature_c[0]?"–":`${F($.winding_temperature_c[0])} · ${F($.winding_temperature_c[1])} °C`} />
<${m} large label="Mission" of=${I($.mission?.energy.battery_j)} note=${$.mission?Q`<a href=${c($.mission.id)}>${$.mission.mission_id}</a>`:"none running"} />
</dl>`}
<${fe} part="RobotHistory" id=${n} />
<${b} title="Recent missions" aside=${Q`<a href=${`#/missions${e({robot:n})}`}>All missions of ${n}</a>`}><${_} of=${u} what="missions">${e=>0===e.missions.length?Q`<${p} title="No mission yet" />`:Q`<div class="scroll"><${Oe} missions=${e.missions} with_robot=${!1} /></div>`}<//><//>
<div class="columns">
<${b} class="screen" title="On the floor now">${h?Q`<${Fe} entry=${h} />`:Q`<${p} title="Never heard" />`}<//>
<${b} title="Model">${d.value?Q`<${ze} model=${d.value.model} />`:Q`<p class="note">none</p>`}<//>
</div>`},missions:function({given:t}){x("Missions");let[n,s]=E(t),[l,r]=E([""]),o=L(JSON.stringify(t));D(()=>{JSON.stringify(t)!==o.current&&(o.current=JSON.stringify(t),s(t),r([""]))},[t]);let i=R(()=>Pe(n),[n]),d=l[l.length-1],u=a(`/v1/missions${e({...i,limit:50,cursor:d})}`),c=a(`/v1/mission-totals${e(i)}`);return Q`
<h1 class="hidden">Missions</h1>
<${Ae} given=${n} change=${e=>{let t=Object.fromEntries(Object.entries(e).filter(([,e])=>""!==e));o.current=JSON.stringify(t),s(t),r([""]),h("missions",t)}} />
<${Le} told=${c} />
<div class="tools"><button type="button" onClick=${()=>{u.reload(),c.reload()}}>Refresh</button>
<span class="note">Times are local (${Intl.DateTimeFormat().resolvedOptions().timeZone})</span>
<${Re} given=${n} total=${c.value?.missions??0} /></div>
<${_} of=${u} what="missions">${({missions:e,next_cursor:t})=>Q`
${u.error&&Q`<${f} error=${u.error} retry=${u.reload} />`}
<div class=${u.loading?"stale":""} aria-busy=${String(u.loading)}>
${0===e.length?Q`<${p} title=${Object.keys(n).length>0?"No mission matches":"No mission yet"}>Missions appear when a robot announces one or sends telemetry.<//>`:Q`<div class="scroll"><${Oe} missions=${e} /></div>`}
</div>
<nav class="pages" aria-label="Pages of missions">
<button type="button" disabled=${1===l.length} onClick=${()=>r(l.slice(0,-1))}>Newer</button>
<span>${F(50*(l.length-1)+Math.min(1,e.length))} – ${F(50*(l.length-1)+e.length)}${c.value?` of ${F(c.value.missions)}`:""}</span>
<button type="button" disabled=${null===t} onClick=${()=>r([...l,t])}>Older</button>
</nav>`}<//>`},mission:function({id:n}){let s=a(`/v1/missions/${t(n)}`),l=null!==s.value,r=a(l?`/v1/missions/${t(n)}/ledger`:null),o=a(l?`/v1/missions/${t(n)}/trace${e({points:700})}`:null),i=null!==o.value&&o.value.start_utime_us.length>=350,d=a(i?`/v1/missions/${t(n)}/trace${e({points:6e3})}`:null),c=i?d.value:o.value;x(s.value?.mission_id??"Mission");let h="open"===s.value?.state;return D(()=>{if(!h)return;let e=setInterval(()=>[s,r,o].forEach(e=>e.reload()),3e3);return()=>clearInterval(e)},[h]),!l&&[400,404].includes(s.error?.status)?Q`<${p} title=${`There is no mission ${n}`}>No mission of this history has that number. See <a href="#/missions">all missions</a>.<//>`:Q`<${_} of=${s} what="the mission">${e=>{let t=e.energy,a=Ee(t);return Q`
<div class="heading"><p class="crumbs"><a href="#/missions">Missions</a> / <a href=${u(e.robot_id)}>${e.robot_id}</a></p>
<h1>${e.mission_id}</h1><${w} mission=${e} />
${e.incomplete&&Q`<span class="flag">incomplete${e.incomplete_reason?`: ${Z(e.incomplete_reason)}`:""}</span>`}
<span class="note">${X(e.start_utime_us)}</span></div>
<dl class="readouts">
<${m} large label=${null===t.measured_j?"From the battery (modelled)":"From the battery"} of=${I(t.battery_j)} channel=${null===t.measured_j?"modelled":"measured"} />
<${m} large label="Modelled" of=${I(t.modelled_j)} channel="modelled" />
<${m} large label="Unexplained" of=${(()=>{let e=I(t.unexplained_j);return{n:B(e.n),u:e.u}})()} channel="gap" note=${null===a?"":`ratio ${F(a,3)}`} />
<${m} large label="Distance" of=${U(t.distance_m)} />
<${m} large label="Duration" of=${V(t.duration_s)} />
<${m} large label="Per metre" of=${H(t.distance_m>.1?t.battery_j/t.distance_m:null,"J/m")} />
<${m} large label="Payload" of=${H(e.payload_kg,"kg")} />
</dl>
<${_} of=${o} what="the trace">${t=>Q`<${qe} mission=${e} whole=${t} fine=${c??t} />`}<//>
<div class="columns">
<${b} title="Where the energy went"><${_} of=${r} what="the ledger">${({ledger:e})=>Q`<${Ie} terms_j=${e.terms_j} battery_j=${e.battery_j} closure=${e.closure_relative} />`}<//><//>
<div>
<${b} title="Against the minimum-energy drive">${null===e.model_version?Q`<${p} title="No model">The robot had no model on this mission.<//>`:h?Q`<${p} title="Still driving">Compared when the mission ends.<//>`:e.gap_s>0?Q`<${p} title="Not compared">For ${V(e.gap_s)} of the mission nothing is known.<//>`:c&&Q`<${Ve} mission=${e} trace=${c} />`}<//>
<${b} title="Record"><${Ke} mission=${e} /><//>
</div>
</div>`}}<//>`},plan:function({given:e}){x("Plan");let a=s(),n=[...a.robots.values()].filter(e=>e.state.has_model).map(e=>e.id).sort(),[l,r]=E(e.robot??""),[o,i]=E("legs"),[d,u]=E(st),[c,$]=E([[-5,-2],[2,-2],[2,2.5],[5,2.5]]),[_,y]=E({payload:"",deadline:"",value:"",charge:""}),[w,k]=E({answer:null,error:null,busy:!1,autonomy:{value:null,error:null}}),M=L(null),j=n.includes(l)?l:n[0]??"",T=R(()=>"legs"===o?function(e){let[t,a,n]=[0,0,0],s=[[t,a]];for(let l of e)if("straight"===l.kind)t+=l.length*Math.cos(n),a+=l.length*Math.sin(n),s.push([t,a]);else if("turn"===l.kind)n+=l.angle*Xe;else if("arc"===l.kind){let e=l.angle<0?-1:1,r=Math.max(2,Math.ceil(Math.abs(l.angle)/5)),o=t-e*l.radius*Math.sin(n),i=a+e*l.radius*Math.cos(n);for(let t=1;t<=r;++t){let a=n+l.angle*Xe*t/r;s.push([o+e*l.radius*Math.sin(a),i-e*l.radius*Math.cos(a)])}n+=l.angle*Xe,[t,a]=s[s.length-1]}return s}(d).filter(([e,t])=>Number.isFinite(e+t)):c,[o,d,c]),C=R(()=>w.answer?.profile.x_m.map((e,t)=>[e,w.answer.profile.y_m[t],w.answer.profile.power_w[t]]),[w.answer]),S=async(e={})=>{let n={..._,...e},s=e=>""===e?void 0:Number(e);if("draw"===o&&c.length<2)return void k(e=>({...e,error:Object.assign(new Error("Draw at least two points."),{title:"No path yet"})}));M.current?.abort();let l=M.current=new AbortController;k(e=>({...e,busy:!0,error:null}));let r={..."draw"===o?et(c):{path:d.map(Qe)},payload_kg:s(n.payload),deadline_s:s(n.deadline),value_of_time_w:s(n.value),pareto_points:24,baseline_columns:!0},i=s(n.charge),u=`/v1/robots/${t(j)}`,h=void 0!==i||null!==a.robots.get(j)?.state.state_of_charge?te(`${u}/autonomy`,{state_of_charge:void 0===i?void 0:i/100,payload_kg:r.payload_kg},l.signal).then(e=>({value:e,error:null}),e=>({value:null,error:e})):{value:null,error:null};try{let e=await te(`${u}/profile`,r,l.signal);k({answer:e,of:T,error:null,busy:!1,autonomy:await h})}catch(e){"AbortError"!==e.name&&k(t=>({...t,error:e,busy:!1}))}};if(D(()=>(""!==j&&S(),()=>M.current?.abort()),[j]),a.loaded&&0===n.length)return Q`<h1>Plan</h1><${p} title="No robot has a model">Put a robot file to <code>/v1/robots/…</code> to plan with it.<//>`;if(!a.loaded)return Q`<${g} what="the fleet" />`;let N=(e,t,a,n)=>Q`<label class="field"><span>${t}</span><span class="with-unit"><input type="number" step="any" min="0" value=${_[e]} onInput=${t=>y({..._,[e]:t.currentTarget.value})} ...${n} /><span class="unit">${a}</span></span></label>`,P=w.answer,O=/^\/path\/(\d+)/.exec(w.error?.field??""),A=P?.baselines;return Q`<h1 class="hidden">Plan</h1><div class="plan">
<form class="plan-form" onSubmit=${e=>{e.preventDefault(),S()}}>
<label class="field"><span>Robot</span><select value=${j} onChange=${e=>{r(e.currentTarget.value),h("plan",{robot:e.currentTarget.value})}}>${n.map(e=>Q`<option key=${e} value=${e}>${e}</option>`)}</select></label>
<${v} label="How to give the path" value=${o} onChange=${i} options=${[["legs","Enter legs"],["draw","Draw"]]} />
${"legs"===o?Q`<${lt} legs=${d} change=${u} fault=${O?Number(O[1]):null} />`:Q`<p class="note">${c.length} points, ${q(U(c.slice(1).reduce((e,[t,a],n)=>e+Math.hypot(t-c[n][0],a-c[n][1]),0)))}. Draw on the floor.</p>`}
<div class="terms">
${N("payload","Payload","kg",{placeholder:"0"})}
${N("deadline","Deadline","s",{placeholder:"free"})}
${N("value","Value of time","W",{placeholder:"0"})}
${N("charge","Charge now","%",{placeholder:"live",max:100})}
</div>
<button type="submit" class="primary" disabled=${""===j}>${w.busy?"Computing …":"Compute"}</button>
</form>
<div class="plan-result" aria-live="polite" aria-busy=${String(w.busy)}>
${w.error&&Q`<${f} error=${w.error} />`}
${"draw"===o&&Q`<${b} class="screen" title="Draw the path"><${nt} points=${c} change=${$} /><//>`}
${null===P?null===w.error&&Q`<${g} what="the plan" />`:Q`<div class=${w.busy?"stale":""}>
<${$t} answer=${P} autonomy=${w.autonomy} />
<dl class="readouts">
<${m} large label="Least energy" of=${I(P.energy_j)} channel="accent" />
<${m} large label="Duration" of=${V(P.duration_s)} />
<${m} large label="Distance" of=${U(P.distance_m)} />
<${m} large label="Top speed" of=${H(P.peak_speed_m_s,"m/s",2)} />
<${m} large label="Per metre" of=${H(P.distance_m>0?P.energy_j/P.distance_m:null,"J/m")} />
</dl>
<div class="columns">
<div>
<${b} class="screen" title="Speed and power"><${ot} answer=${P} /><//>
<${b} title="Against the usual profiles">
<${We} label="Energy of the plan, a trapezoid and a triangle in the same time" rows=${[{name:"Least energy",value:P.energy_j,of:I(P.energy_j),channel:"least",note:""},...["trapezoid","triangle"].map(e=>({name:e[0].toUpperCase()+e.slice(1),value:A[e]?.energy_j??null,of:I(A[e]?.energy_j),channel:"plain",note:ct(A[e])}))]} />
<p class="note foot">All three in the same time on every run between stops.</p>
<//>
<${b} title="Where the energy goes"><${Ie} terms_j=${P.ledger_j} battery_j=${P.energy_j} measured=${!1} /><//>
</div>
<div>
<${b} class="screen" title="On the floor"><${je} points=${C} under=${w.of===T?null:T} height=${340} label="The planned path, coloured by power; circle: start, square: end" /><//>
<${b} class="screen" title="Energy against time">${P.pareto.length<2?Q`<${p} title="No front">Nothing to trade: time and energy do not compete on this path.<//>`:Q`<${it} answer=${P} take=${({duration_s:e})=>{let t=String(Math.ceil(100*e)/100);y({..._,deadline:t}),S({deadline:t})}} />`}<//>
<${b} title="How sure the optimum is"><${ht} answer=${P} /><//>
</div>
</div></div>`}
${"legs"===o&&null===P&&T.length>1&&Q`<${b} class="screen" title="Path"><${je} points=${T.map(([e,t])=>[e,t,NaN])} legend=${!1} label="The path that was entered" /><//>`}
</div></div>`},gap:e=>Q`<${fe} part="Gap" ...${e} />`};function pt(){let e=s(),t={live:"Live",connecting:"Connecting",offline:"Offline"}[e.link];return Q`<span class=${`link ${e.link}`} role="status"><span class="lamp" aria-hidden="true"></span>${t}</span>`}function gt(){let e=s(),[t,a]=E(!1);if(D(()=>{if(a(!1),"offline"!==e.link)return;let t=setTimeout(()=>a(!0),1500);return()=>clearTimeout(t)},[e.link]),!t)return null;let n=Y(1e3*e.since_ms);return Q`<div class="banner" role="alert">No connection to the service since ${n}. What is shown is as of then; trying again.</div>`}n(),N(Q`<${function(){let[e,t]=E(d(location.hash)),a=L(null),n=L(!0),s=o();D(()=>{let e=()=>t(d(location.hash));return addEventListener("hashchange",e),()=>removeEventListener("hashchange",e)},[]),D(()=>{n.current?n.current=!1:(scrollTo(0,0),a.current.focus({preventScroll:!0}))},[e.view,e.id]);let l=mt[e.view],i={robots:"fleet",mission:"missions"}[e.view]??e.view,u=(e,t)=>Q`<a href=${`#/${e}`} aria-current=${i===e?"page":void 0}>${t}</a>`;return Q`
<a class="skip" href="#main" onClick=${e=>{e.preventDefault(),a.current.focus()}}>Skip to content</a>
<header class="top">
<a class="mark" href="#/fleet" aria-label="joulecast, fleet">
<svg viewBox="0 0 32 20" width="38" height="24" aria-hidden="true"><path d="M1 14h6l4-12 6 17 4-10 2 5h8" /></svg>joulecast</a>
<nav aria-label="Views">${u("fleet","Fleet")}${u("missions","Missions")}${u("plan","Plan")}${u("gap","Gap")}</nav>
<${pt} />
<button type="button" class="theme" onClick=${r} aria-label=${s?"Light theme":"Dark theme"} title=${s?"Light theme":"Dark theme"}>
<svg viewBox="0 0 20 20" width="18" height="18" aria-hidden="true"><circle cx="10" cy="10" r="7.5" class="ring" /><path d="M10 2.5a7.5 7.5 0 0 1 0 15z" /></svg></button>
</header>
<${gt} />
<main id="main" tabindex="-1" ref=${a}>
<${k} view=${location.hash}>
${l?Q`<${l} key=${`${e.view}/${e.id??""}`} id=${e.id} given=${e.given} />`:Q`<${p} title="There is no such page">Go to the <a href="#/fleet">fleet</a>.<//>`}
<//>
</main>`}} />`,document.getElementById("app"));
