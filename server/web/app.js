/* joulecast operator page, built from source/; licences: third_party.txt */
import{$ as e,A as t,B as a,C as n,E as s,F as l,G as r,H as o,I as i,J as d,K as u,L as c,M as h,N as $,O as m,P as p,Q as g,R as f,S as _,T as b,U as v,V as y,W as w,X as k,Y as x,Z as M,_ as j,a as T,aa as C,b as N,ba as S,c as P,ca as E,d as O,da as A,e as D,f as L,fa as R,g as z,ga as F,h as W,ha as B,i as J,ia as I,j as U,k as G,l as H,m as q,n as V,o as K,p as X,s as Y,t as Z,u as Q,v as ee,w as te,x as ae,y as ne,z as se}from"./base.js";var le=class extends N{canvas=T();shouldComponentUpdate(e){return e.revision!==this.props.revision||e.dark!==this.props.dark||e.track!==this.props.track}componentDidMount(){this.draw()}componentDidUpdate(){this.draw()}draw(){let e=this.canvas.current,{width:t=128,height:a=30,track:n}=this.props,s=devicePixelRatio||1,l=e.getContext("2d"),r=h();e.width!==t*s&&(e.width=t*s,e.height=a*s),l.setTransform(s,0,0,s,0,0),l.clearRect(0,0,t,a),l.strokeStyle=r.graticule,l.lineWidth=1,l.beginPath();for(let e=t-.5;e>0;e-=32)l.moveTo(e,0),l.lineTo(e,a);let o=n.last(),i=1,d=0;for(let[,e,t]of o)e>i&&(i=e),t>i&&(i=t),e<d&&(d=e);let u=e=>a-2-(e-d)/(i-d)*(a-5);if(l.moveTo(0,Math.round(u(0))+.5),l.lineTo(t,Math.round(u(0))+.5),l.stroke(),o.length<2)return;let c=o[o.length-1][0];for(let[e,a,n]of[[2,r.modelled,1],[1,r.measured,1.5]]){l.strokeStyle=a,l.lineWidth=n,l.lineJoin="round",l.beginPath();let s=-1/0;for(let a of o){let n=t-2-(c-a[0])/9e7*t;Number.isFinite(a[e])&&(a[0]-s>5e6?l.moveTo(n,u(a[e])):l.lineTo(n,u(a[e])),s=a[0])}l.stroke()}}render(){let{width:e=128,height:a=30}=this.props;return t`<canvas class="sparkline" ref=${this.canvas} style=${{width:`${e}px`,height:`${a}px`}} aria-hidden="true"></canvas>`}};function re(e,a){return J(e?.p05)&&J(e.p95)?t`<span title="nine times of ten"><span class="hidden">90 % between </span>${a(e.p05,e.p95)}</span>`:""}var oe=e=>(t,a)=>{let n=e(t.state),s=e(a.state);return(null==n)-(null==s)||(n<s?-1:n>s?1:0)},ie=new Intl.Collator("en",{numeric:!0}),de=[{key:"robot",title:"Robot",sort:(e,t)=>ie.compare(e.id,t.id),class:"robot"},{key:"health",title:"Telemetry",sort:oe(e=>e.live?0:null===e.silent_s?1/0:1+e.silent_s),class:"health"},{key:"power",title:"Power",sort:oe(e=>e.measured_power_w??e.modelled_power_w),class:"figure power"},{key:"trace",title:"Last 90 s",class:"spark"},{key:"charge",title:"Charge",sort:oe(e=>e.state_of_charge),class:"charge"},{key:"range",title:"Range",sort:oe(e=>e.range_m),class:"figure range"},{key:"time",title:"Run time",sort:oe(e=>e.run_time_s),class:"figure wide"},{key:"speed",title:"Speed",sort:oe(e=>e.speed_m_s),class:"figure wide"},{key:"mission",title:"Mission",sort:oe(e=>e.mission?.start_utime_us),class:"mission"},{key:"spent",title:"Spent",sort:oe(e=>e.mission?.energy.battery_j),class:"figure spent"}],ue=e=>null===e.silent_s;function ce({state:e}){let{level:a,text:n,faults:s}=function(e){let t=Object.values(e.faults).reduce((e,t)=>e+t,0);return e.has_model?e.live?{level:"good",text:"live",faults:t}:ue(e)?{level:"none",text:"not heard",faults:t}:{level:"bad",text:`silent ${ee(e.silent_s)}`,faults:t}:{level:"bad",text:"no model",faults:t}}(e),l=Object.entries(e.faults).map(([e,t])=>`${t} ${se(e)}`).join(", ");return t`<span class=${`lamp ${a}`} aria-hidden="true"></span>${n}
${s>0&&t`<span class="note" title=${l}> · ${U(s)} faulty</span>`}`}function he({charging:e,charge:t,state_of_charge_sd:a}){let n=t?.time_to_charged_s;return"full"===e?.phase?{text:"charged",what:"At its charger, which has ended"}:e?{text:"charging"+(J(n)?`, ${te(n)}`:""),what:"At its charger"+(J(n)?`, ready in ${te(n)}`:"")}:{text:J(a)?`± ${Q(Y(a))}`:"",what:"standard deviation"}}function $e({state:e}){let a=e.state_of_charge;if(null===a)return t`<span class="note">unknown</span>`;let{text:n,what:s}=he(e);return t`<span class=${"charge-bar "+(e.charging?"charging":a<.25?"low":"")} aria-hidden="true"><span style=${{width:`${Math.max(2,100*a)}%`}}></span></span>
<${f} of=${Y(a)} /><span class="below" title=${s}>${n}</span>`}var me=class extends N{shouldComponentUpdate(e){return e.revision!==this.props.revision||e.entry!==this.props.entry||e.index!==this.props.index||e.dark!==this.props.dark}render({entry:e,index:a,revision:n,dark:s}){let l=e.state,r=null===l.measured_power_w;return t`<tr aria-rowindex=${a+2} class=${l.live?"":"quiet"}>
<th scope="row" class="robot"><a href=${m(e.id)}>${e.id}</a></th>
<td class="health"><${ce} state=${l} /></td>
<td class="figure power"><${f} of=${V(l.measured_power_w??l.modelled_power_w)} />${r&&null!==l.modelled_power_w&&t`<span class="note"> mod.</span>`}</td>
<td class="spark"><${le} track=${e.power} revision=${n} dark=${s} /></td>
<td class="charge"><${$e} state=${l} /></td>
<td class="figure range"><${f} of=${K(l.range_m)} /><span class="below">${re(l.range_quantiles_m,X)}</span></td>
<td class="figure wide">${te(l.run_time_s)}</td>
<td class="figure wide"><${f} of=${Z(l.speed_m_s,"m/s",2)} /></td>
<td class="mission">${l.mission?t`<a href=${p(l.mission.id)} title=${l.mission.mission_id}>${((e,t)=>e.startsWith(`${t}-`)?e.slice(t.length+1):e)(l.mission.mission_id,e.id)}</a>`:t`<span class="note">idle</span>`}</td>
<td class="figure spent"><${f} of=${q(l.mission?.energy.battery_j)} /></td>
</tr>`}};function pe({robots:e}){let[a,n,s,l,r,o,i,d]=[0,0,0,0,null,!1,0,0];for(let{state:t}of e.values()){let e=t.measured_power_w??t.modelled_power_w;t.live&&(n+=1,null!==t.charging?(i+=1,d-=Math.min(0,t.measured_power_w??0)):null!==e&&(a+=e,o=!0)),null!==t.mission&&(s+=1,l+=t.mission.energy.battery_j),null!==t.state_of_charge&&(null===r||t.state_of_charge<r.state_of_charge)&&(r=t)}return t`<dl class="readouts">
<${_} large label="Fleet power" of=${o?V(a):{n:"–",u:""}} channel="measured" />
<${_} large label="Live" of=${`${n}`} note=${`of ${e.size}`} />
<${_} large label="On a mission" of=${`${s}`} />
<${_} large label="Spent in running missions" of=${q(s>0?l:null)} />
${i>0&&t`<${_} large label="Charging" of=${`${i}`} note=${`at ${Q(V(d))}`} />`}
<${_} large label="Lowest charge" of=${Y(r?.state_of_charge)} note=${r&&t`<a href=${m(r.robot_id)}>${r.robot_id}</a>`} />
</dl>`}var ge=null,fe=null;function _e({part:e,...a}){let[,n]=O(0),[s,l]=O(null),r=()=>n(e=>e+1),o=()=>{l(null),document.getElementById("gap-style")||document.head.append(Object.assign(document.createElement("link"),{id:"gap-style",rel:"stylesheet",href:"gap-style.css"})),(ge??=import("./gap.js").then(e=>{fe=e},e=>{throw ge=null,e}),ge).then(r,()=>l({status:0,title:"This part of the page could not be loaded",message:"The service may be restarting, or the network is down."}))};if(D(()=>{null===fe&&o()},[]),null!==s)return t`<${y} error=${s} retry=${o} />`;if(null===fe)return t`<${v} what="this part of the page" />`;let i=fe[e];return t`<${i} ...${a} />`}var be={light:[[200,206,196],[226,178,92],[212,104,44],[150,38,48],[72,14,52]],dark:[[44,58,62],[104,72,104],[196,82,72],[250,152,56],[255,238,170]]},ve={light:[[20,84,140],[120,170,200],[196,196,190],[226,140,100],[172,36,34]],dark:[[70,170,255],[60,106,150],[78,84,84],[176,92,64],[255,120,84]]};function ye(e,t,a,n,s){return{scale:e,width:n,height:s,to:(l,r)=>[n/2+(l-t)*e,s/2-(r-a)*e],from:(l,r)=>[t+(l-n/2)/e,a-(r-s/2)/e]}}function we(e){let t=10**Math.floor(Math.log10(e));return[5,2,1].map(e=>e*t).find(t=>t<=e)??t}function ke(e,t){let a=h(),n=we(90/t.scale),[s,l]=t.from(0,0),[r,o]=t.from(t.width,t.height);e.strokeStyle=a.graticule,e.lineWidth=1,e.beginPath();for(let a=Math.ceil(s/n)*n;a<=r;a+=n){let n=Math.round(t.to(a,0)[0])+.5;e.moveTo(n,0),e.lineTo(n,t.height)}for(let a=Math.ceil(o/n)*n;a<=l;a+=n){let n=Math.round(t.to(0,a)[1])+.5;e.moveTo(0,n),e.lineTo(t.width,n)}e.stroke()}function xe(e,t){let a=h(),n=we(120/t.scale),s=n*t.scale,l=14.5,r=t.height-14.5;e.strokeStyle=e.fillStyle=a.ink,e.lineWidth=1.5,e.beginPath(),e.moveTo(l,r-5),e.lineTo(l,r),e.lineTo(l+s,r),e.lineTo(l+s,r-5),e.stroke(),e.font='12px "Liberation Sans", "Helvetica Neue", Arial, sans-serif',e.textAlign="left",e.textBaseline="alphabetic",e.fillText(`${G(n,1)} m`,l+s+6,r)}function Me(e,t,a,n,s,l){let[r,o]=t.to(a,n);e.save(),e.translate(r,o),e.rotate(-s),e.fillStyle=l,e.strokeStyle=h().screen,e.lineWidth=2,e.beginPath(),e.moveTo(11,0),e.lineTo(-7,7),e.lineTo(-3.5,0),e.lineTo(-7,-7),e.closePath(),e.stroke(),e.fill(),e.restore()}function je({draw:e,height:a,label:n,changes:s,...l}){let r=z(null),o=z(e),i=c();o.current=e;let d=()=>{let e=r.current,t=devicePixelRatio||1,n=e?.clientWidth??0;if(0===n)return;(e.width!==Math.round(n*t)||e.height!==Math.round(a*t))&&(e.width=Math.round(n*t),e.height=Math.round(a*t));let s=e.getContext("2d");s.setTransform(t,0,0,t,0,0),s.clearRect(0,0,n,a),o.current(s,n,a)};return L(()=>{let e=new ResizeObserver(d);return e.observe(r.current),()=>e.disconnect()},[a]),D(d,[i,...s]),t`<canvas class="floor" role="img" aria-label=${n} ref=${r} style=${{height:`${a}px`}} ...${l}></canvas>`}function Te({points:e,kind:a="power",height:n=380,label:s,cursor:l=null,robot:r=null,legend:o=!0,ends:i=!0,under:u=null}){let $=e.filter(([e,t])=>Number.isFinite(e)&&Number.isFinite(t)),m=c(),p=function(e,t){let a=t.filter(Number.isFinite).map(t=>"gap"===e?Math.abs(t):t).sort((e,t)=>e-t),n=Math.max(a.length>0?a[Math.floor(.98*(a.length-1))]:1,.001),s=10**Math.floor(Math.log10(n))/2,l=Math.ceil(n/s)*s,r="gap"===e?-l:0,o=function(e){let t=[];for(let a=0;a<64;++a){let n=a/63*(e.length-1),s=Math.min(Math.floor(n),e.length-2),l=n-s,r=e[s].map((t,a)=>Math.round(t+(e[s+1][a]-t)*l));t.push(`rgb(${r.join(" ")})`)}return t}(("gap"===e?ve:be)[d()?"dark":"light"]);return{low:r,high:l,colours:o,colour_of:e=>o[Math.max(0,Math.min(63,Math.round((e-r)/(l-r)*63)))]}}(a,$.map(e=>e[2]));return t`<div class="floor-box">
<${je} draw=${(t,a,n)=>{let s=function(e,t,a,n=28,s=2){let[l,r,o,i]=[1/0,-1/0,1/0,-1/0];for(let[t,a]of e)!Number.isFinite(t)||!Number.isFinite(a)||(l=Math.min(l,t),r=Math.max(r,t),o=Math.min(o,a),i=Math.max(i,a));return l>r&&([l,r,o,i]=[-s,s,-s,s]),ye(Math.min((t-2*n)/Math.max(r-l,s),(a-2*n)/Math.max(i-o,s)),(l+r)/2,(o+i)/2,t,a)}([...$,...r?[r]:[],...u??[]],a,n,34);ke(t,s),null!==u&&function(e,t,a){e.strokeStyle=h().muted,e.lineWidth=1.25,e.setLineDash([5,4]),e.beginPath(),a.forEach(([a,n],s)=>e[0===s?"moveTo":"lineTo"](...t.to(a,n))),e.stroke(),e.setLineDash([])}(t,s,u),t.lineWidth=3.2,t.lineCap="round",t.lineJoin="round";let o=null;for(let e=1;e<$.length;++e){let a=$[e][2],n=Number.isFinite(a)?p.colour_of(a):h().line;n!==o&&(null!==o&&t.stroke(),t.strokeStyle=o=n,t.beginPath(),t.moveTo(...s.to($[e-1][0],$[e-1][1]))),t.lineTo(...s.to($[e][0],$[e][1]))}null!==o&&t.stroke(),$.length>1&&i&&function(e,t,a){let n=h(),s=a[0],l=a[a.length-1];e.lineWidth=2,e.strokeStyle=n.ink,e.fillStyle=n.screen;let[r,o]=t.to(s[0],s[1]);e.beginPath(),e.arc(r,o,5,0,7),e.fill(),e.stroke();let[i,d]=t.to(l[0],l[1]);e.fillStyle=n.ink,e.fillRect(i-4.5,d-4.5,9,9)}(t,s,$),r&&Me(t,s,r[0],r[1],r[2]??0,h().ink);let d=null===l?null:e[l];if(d&&Number.isFinite(d[0])){let[e,l]=s.to(d[0],d[1]);t.strokeStyle=h().ink,t.lineWidth=1,t.beginPath(),t.moveTo(e,0),t.lineTo(e,n),t.moveTo(0,l),t.lineTo(a,l),t.stroke(),t.fillStyle=h().accent,t.beginPath(),t.arc(e,l,6,0,7),t.fill(),t.stroke()}xe(t,s)}} height=${n} label=${s} changes=${[e,a,l,r,u]} />
${o&&$.some(e=>e[2]>0||"gap"===a)&&t`<${Ce} scale=${p} dark=${m} title=${"gap"===a?"measured − modelled":"power"} />`}
</div>`}function Ce({scale:e,title:a,unit:n="W"}){let s=(e.low+e.high)/2;return t`<div class="legend">
<span class="legend-title">${a}</span>
<span class="number">${G(e.low,2)}</span>
<${je} draw=${(t,a,n)=>{let s=a/e.colours.length;e.colours.forEach((e,a)=>{t.fillStyle=e,t.fillRect(a*s,0,s+1,n)})}} height=${10} label=${`Colours from ${e.low} to ${e.high} ${n}`} changes=${[e.low,e.high,a]} />
<span class="number">${G(e.high,2)}${" "}${n}</span>
${"power"!==a&&t`<span class="note">neutral at ${G(s,1)}</span>`}
</div>`}var Ne={id:e=>e.id,robot_id:e=>e.robot_id,mission_id:e=>e.mission_id,state:e=>e.state,incomplete:e=>e.incomplete,incomplete_reason:e=>e.incomplete_reason,start_utime_us:e=>e.start_utime_us,end_utime_us:e=>e.end_utime_us,payload_kg:e=>e.payload_kg,model_version:e=>e.model_version,battery_j:e=>e.energy.battery_j,measured_j:e=>e.energy.measured_j,measured_s:e=>e.energy.measured_s,modelled_j:e=>e.energy.modelled_j,unexplained_j:e=>e.energy.unexplained_j,drawn_j:e=>e.energy.drawn_j,returned_j:e=>e.energy.returned_j,charge_ah:e=>e.energy.charge_ah,distance_m:e=>e.energy.distance_m,turned_rad:e=>e.energy.turned_rad,duration_s:e=>e.energy.duration_s,samples:e=>e.samples,gap_count:e=>e.gap_count,gap_s:e=>e.gap_s,note:e=>e.note},Se=e=>`${Object.values(Ne).map(t=>function(e){if(null==e)return"";if("string"!=typeof e)return String(e);let t=/^[=+\-@\t\r]/.test(e)?`'${e}`:e;return/[",\r\n]/.test(t)?`"${t.replaceAll('"','""')}"`:t}(t(e))).join(",")}\r\n`,Pe=e=>e?1e3*new Date(e).getTime():void 0;function Ee(e){return{robot_id:e.robot,mission_id:e.name,state:e.state,incomplete:e.incomplete,from_utime_us:Pe(e.from),to_utime_us:Pe(e.to),payload_min_kg:e.payload_min,payload_max_kg:e.payload_max}}var Oe=({measured_j:e,modelled_j:t})=>null!==e&&0!==t?e/t:null;function Ae({missions:e,with_robot:a=!0}){return t`<table class="grid missions">
<thead><tr>
<th scope="col">Started</th>${a&&t`<th scope="col">Robot</th>`}<th scope="col">Mission</th><th scope="col">State</th>
<th scope="col" class="figure">Duration</th><th scope="col" class="figure">Distance</th><th scope="col" class="figure wide">Payload</th>
<th scope="col" class="figure">Energy</th><th scope="col" class="figure wide">Modelled</th>
<th scope="col" class="figure"><abbr title="measured over modelled energy">Ratio</abbr></th><th scope="col" class="figure wide">Per metre</th>
</tr></thead>
<tbody>${e.map(e=>t`<tr key=${e.id}>
<td class="when">${ae(e.start_utime_us)}</td>
${a&&t`<td><a href=${m(e.robot_id)}>${e.robot_id}</a></td>`}
<th scope="row"><a href=${p(e.id)}>${e.mission_id}</a></th>
<td><${j} mission=${e} />${e.incomplete&&t` <span class="flag" title=${e.incomplete_reason??""}>incomplete</span>`}</td>
<td class="figure">${ee(e.energy.duration_s)}</td>
<td class="figure"><${f} of=${K(e.energy.distance_m)} /></td>
<td class="figure wide"><${f} of=${Z(e.payload_kg,"kg")} /></td>
<td class="figure"><${f} of=${q(e.energy.battery_j)} /></td>
<td class="figure wide"><${f} of=${q(e.energy.modelled_j)} /></td>
<td class="figure"><${De} value=${Oe(e.energy)} /></td>
<td class="figure wide"><${f} of=${e.energy.distance_m>.1?Z(e.energy.battery_j/e.energy.distance_m,"J/m"):Z(null)} /></td>
</tr>`)}</tbody>
</table>`}function De({value:e}){return t`<span class=${J(e)&&Math.abs(e-1)>.1?"ratio off":"ratio"}>${U(e,3)}</span>`}function Le({given:e,change:a}){let n=[...i().robots.keys()].sort(),s=C(n),l=t=>n=>a({...e,[t]:n.currentTarget.value}),r=(e,a)=>t`<label class="field"><span>${e}</span>${a}</label>`,o=Object.values(e).some(e=>""!==e&&void 0!==e);return t`<form class="filters" aria-label="Filter missions" onSubmit=${e=>e.preventDefault()}>
${r("Robot",t`<select value=${e.robot??""} onChange=${l("robot")}><option value="">all</option>
${e.robot&&!n.includes(e.robot)&&t`<option value=${e.robot}>${e.robot}</option>`}
${s}</select>`)}
${r("From",t`<input type="datetime-local" value=${e.from??""} onChange=${l("from")} />`)}
${r("To",t`<input type="datetime-local" value=${e.to??""} onChange=${l("to")} />`)}
<fieldset class="field"><legend>Payload, kg</legend><span class="with-unit">
<input class="short" type="number" min="0" step="any" aria-label="Payload, from kg" placeholder="from" value=${e.payload_min??""} onChange=${l("payload_min")} />
<input class="short" type="number" min="0" step="any" aria-label="Payload, to kg" placeholder="to" value=${e.payload_max??""} onChange=${l("payload_max")} /></span></fieldset>
${r("State",t`<select value=${e.state??""} onChange=${l("state")}><option value="">all</option>${Object.entries(M).map(([e,a])=>t`<option key=${e} value=${e}>${a}</option>`)}</select>`)}
${r("Record",t`<select value=${e.incomplete??""} onChange=${l("incomplete")}><option value="">all</option><option value="false">complete</option><option value="true">incomplete</option></select>`)}
${r("Named",t`<input type="text" value=${e.name??""} onChange=${l("name")} />`)}
<button type="button" class="plain" disabled=${!o} onClick=${()=>a({})}>Clear</button>
</form>`}function Re({told:e}){return t`<${w} of=${e} what="totals">${e=>{let a=e.energy,n=e.missions>0;return t`<dl class="readouts">
<${_} label="Missions" of=${U(e.missions)} note=${e.incomplete_missions>0?`${U(e.incomplete_missions)} incomplete`:""} />
<${_} label="Energy from the batteries" of=${q(n?a.battery_j:null)} channel="measured" />
<${_} label="Modelled" of=${q(n?a.modelled_j:null)} channel="modelled" />
<${_} label="Unexplained" of=${q(a.unexplained_j)} channel="gap" note=${null!==a.unexplained_j&&0!==a.battery_j?`${U(100*a.unexplained_j/a.battery_j,1)} %`:""} />
<${_} label="Distance" of=${K(a.distance_m)} />
<${_} label="Per metre" of=${Z(a.distance_m>0?a.battery_j/a.distance_m:null,"J/m")} />
<${_} label="Duration" of=${ee(a.duration_s)} />
</dl>`}}<//>`}function ze({given:e,total:n}){let[l,r]=O(null),[o,i]=O(null),d=z(null);D(()=>()=>d.current?.abort(),[]);let u=async t=>{d.current=new AbortController,i(null),r(0);try{await async function(e,t,n,l){let r,o=["csv"===e?`${Object.keys(Ne).join(",")}\r\n`:"[\n"],i=0;do{let d=await a(`/v1/missions${s({...t,limit:1e3,cursor:r})}`,l);d.missions.length>0&&("csv"===e?o.push(d.missions.map(Se).join("")):o.push((i>0?",\n":"")+d.missions.map(e=>JSON.stringify(e)).join(",\n"))),i+=d.missions.length,r=d.next_cursor,n(i)}while(null!==r);"json"===e&&o.push("\n]\n"),function(e,t,a){let n=URL.createObjectURL(new Blob(e,{type:a})),s=Object.assign(document.createElement("a"),{href:n,download:t});document.body.append(s),s.click(),s.remove(),setTimeout(()=>URL.revokeObjectURL(n),6e4)}(o,`joulecast-missions-${(new Date).toISOString().slice(0,19).replaceAll(":","")}.${e}`,"csv"===e?"text/csv":"application/json")}(t,Ee(e),r,d.current.signal)}catch(e){"AbortError"!==e.name&&i(e)}r(null)};return null!==l?t`<div class="export" role="status">
<progress max=${n||1} value=${l}></progress> ${U(l)} of ${U(n)}
<button type="button" onClick=${()=>d.current.abort()}>Stop</button></div>`:t`<div class="export">${o&&t`<span class="fault" role="alert">${o.message}</span>`}
<button type="button" disabled=${!n} onClick=${()=>u("csv")}>Export CSV</button>
<button type="button" disabled=${!n} onClick=${()=>u("json")}>Export JSON</button></div>`}function Fe({model:e}){return t`<details class="model"><summary>Parameters in force</summary>
<table class="facts"><tbody>${Object.entries(I(e)).filter(([e])=>"robot_id"!==e).map(([e,a])=>t`<tr key=${e}><th scope="row"><code>${e}</code></th><td>${a}</td></tr>`)}</tbody></table></details>`}function We({entry:e}){let a=e.state.mission?.id,n=r(a?`/v1/missions/${a}/trace?points=600`:null),[s]=O({mission:null,rows:[]});s.mission!==a&&Object.assign(s,{mission:a,rows:[]});let l=e.path.last(),o=[...a&&n.value&&n.value.id===a?n.value.x_m.map((e,t)=>[e??NaN,n.value.y_m[t]??NaN,n.value.measured_power_w.mean[t]??n.value.modelled_power_w.mean[t]??NaN]):[],...l.map(([e,t,,a])=>[e,t,a])],[i,d,u]=e.state.pose;return 0===o.length||null===i?t`<${b} title="No position">${null===e.state.silent_s?"Nothing heard yet.":"This robot does not tell where it is."}<//>`:t`<${Te} points=${o} height=${340} ends=${!1} robot=${[i,d,u??0]} label=${`Path of ${e.id} so far, coloured by power, and where it is now`} />`}function Be({rows:e,label:a}){let n=Math.max(...e.map(e=>e.value??0),1e-9);return t`<table class="bars" aria-label=${a}><tbody>${e.map(e=>t`<tr key=${e.name}>
<th scope="row">${e.name}</th>
<td class="bar-cell"><svg width="100%" height="18" aria-hidden="true" focusable="false"><rect class=${`account ${e.channel}`} x="0" y="3" height="12" width=${100*Math.max(0,e.value??0)/n+"%"} /></svg></td>
<td class="figure"><${f} of=${e.of} /></td>
<td class="note">${e.note}</td></tr>`)}</tbody></table>`}var Je={accessories:"Idle and accessories",driver:"Motor drivers",copper:"Copper",brush:"Brushes",friction_internal:"Friction in motors and gears",friction_rolling:"Rolling",friction_scrub:"Scrub in turns",friction_zone:"Floor zones",friction_slip:"Wheel slip",drag:"Air",kinetic:"Change of motion",potential:"Change of height",braking:"Generated in braking",recovered:"Recovered",sensor:"Sensor fault",unexplained:"Unexplained"};function Ie({terms_j:e,battery_j:a,closure:n,measured:s=!0}){let{rows:l,sum:r,absent:o}=function(e,t){let a=e=>Math.abs(e)<=1e-5*Math.abs(t),n=[],s=0;for(let[t,l]of Object.entries(e)){let e="recovered"===t?-l:l;"unexplained"===t&&n.push({key:"modelled",name:"Modelled",from:0,to:s,total:!0}),a(l)&&"unexplained"!==t||n.push({key:t,name:Je[t]??se(t),from:s,to:s+e,change:e}),s+=e}return{rows:n,sum:s,absent:Object.entries(e).filter(([e,t])=>a(t)&&"unexplained"!==e).map(([e])=>(Je[e]??e).toLowerCase())}}(e,a),i=s?l:l.filter(e=>"unexplained"!==e.key&&"modelled"!==e.key),d=i.flatMap(e=>[e.from,e.to]).concat(a,0),u=Math.min(...d),c=Math.max(...d),h=Math.max(c-u,1e-9),$=e=>(e-u)/h*100,m=[...i,{key:"battery",name:s?"From the battery":"Total",from:0,to:a,total:!0}];return t`<div class="waterfall">
<svg class="patterns" width="0" height="0" aria-hidden="true" focusable="false"><defs><pattern id="hatch" width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)"><rect class="hatch-back" width="6" height="6" /><line class="hatch-line" x1="0" x2="0" y1="0" y2="6" /></pattern></defs></svg>
<table>
<thead class="hidden"><tr><th scope="col">Account</th><th scope="col">Bar</th><th scope="col">Energy</th><th scope="col">Share</th></tr></thead>
<tbody>
${m.map(e=>{let n=e.total?e.to:e.change;return t`<tr key=${e.key} class=${e.total?`total ${e.key}`:"unexplained"===e.key?"odd":""}>
<th scope="row">${e.name}</th>
<td class="bar-cell">${(e=>{let n=Math.min($(e.from),$(e.to)),s=Math.abs($(e.to)-$(e.from));return t`<svg class="bar" width="100%" height=${30} aria-hidden="true" focusable="false">
<line class="zero" x1=${`${$(0)}%`} x2=${`${$(0)}%`} y1="0" y2=${30} />
<line class="goal" x1=${`${$(a)}%`} x2=${`${$(a)}%`} y1="0" y2=${30} />
${"battery"!==e.key&&t`<line class="step" x1=${`${$(e.to)}%`} x2=${`${$(e.to)}%`} y1=${23} y2=${30} />`}
<rect class=${`account ${e.total?e.key:"unexplained"===e.key?"unexplained":e.change<0?"back":"out"}`}
x=${`${n}%`} y="7" width=${`${Math.max(s,.15)}%`} height=${16} />
</svg>`})(e)}</td>
<td class="figure"><${f} of=${q(n)} sign=${!e.total} /></td>
<td class="figure share">${0!==a?U(100*n/a,1):"–"}${" "}%</td>
</tr>`})}
</tbody>
</table>
<p class="closing">
Accounts add up to <b>${U(r,2)}${" "}J</b>; the battery gave <b>${U(a,2)}${" "}J</b>.
${void 0!==n&&t` ${n<1e-9?"Closes":"Does not close"}: difference ${0===n?"none":n.toExponential(1)} of the whole.`}
${o.length>0&&t` <span class="note">Next to nothing in: ${o.join(", ")}.</span>`}
</p>
</div>`}var Ue=(e,t)=>t.map(e=>{if(null===e)return"";let t=e<0?"−":"",a=Math.abs(e),n=e=>String(Math.floor(e)).padStart(2,"0");return a<3600?`${t}${Math.floor(a/60)}:${n(a%60)}`:`${t}${Math.floor(a/3600)}:${n(a%3600/60)}:${n(a%60)}`});function Ge({trace:e,mission:a,zoom:n,set_zoom:s,set_cursor:l}){let[r,o]=W(()=>{let t=(...t)=>function(e,t,a){let n=function(e,t){return e.start_utime_us.map(a=>(a-t+e.width_us/2)/1e6)}(e,t),s=[];for(let t=1;t<n.length;++t)e.start_utime_us[t]-e.start_utime_us[t-1]>1.9*e.width_us&&s.push(t);if(0===s.length)return[n,...a];let l=(e,t)=>{let a=[];return e.forEach((n,l)=>{s.includes(l)&&a.push(void 0===t?(e[l-1]+n)/2:t),a.push(n)}),a};return[l(n),...a.map(e=>l(e,null))]}(e,a.start_utime_us,t.flatMap(e=>[e.max,e.min,e.mean]));return[t(e.measured_power_w,e.modelled_power_w),t(e.speed_m_s)]},[e]),i=z(e);i.current=e;let d={setCursor:[e=>l(null===e.cursor.idx||void 0===e.cursor.idx?null:qe(i.current,a.start_utime_us+1e6*e.data[0][e.cursor.idx]))],setSelect:[e=>{e.select.width<6||(s([e.posToVal(e.select.left,"x"),e.posToVal(e.select.left+e.select.width,"x")]),e.setSelect({left:0,top:0,width:0,height:0},!1))}]},u={...B("mission"),drag:{x:!0,y:!1,setScale:!1,dist:6},bind:{dblclick:()=>()=>s(null)}},c=e=>E(e,{size:28,incrs:A,values:Ue}),$=z([]),m=z(0);return t`<div class="charts" tabindex="0" role="group" aria-label="Power and speed over time. Left and right move the cursor, plus looks closer, minus shows the whole mission." onKeyDown=${e=>{let t=$.current[0].data[0],a=Math.max(1,Math.round(t.length/20)),n=e.shiftKey?a:1,l={ArrowLeft:m.current-n,ArrowRight:m.current+n,Home:0,End:t.length-1}[e.key],r=t[t.length-1]-t[0],o=t[Math.min(m.current,t.length-1)];if(void 0!==l){m.current=Math.max(0,Math.min(t.length-1,l));for(let e of $.current)e.setCursor({left:e.valToPos(t[m.current],"x"),top:8})}else if("+"===e.key&&r>4)s([Math.max(t[0],o-r/4),Math.min(t[t.length-1],o+r/4)]);else{if("-"!==e.key&&"Escape"!==e.key)return;s(null)}e.preventDefault()}}>
<${R} make=${()=>{let e=h(),t={show:!0,stroke:"transparent",points:{show:!1}};return{cursor:u,hooks:d,scales:{x:{time:!1}},axes:[c(""),E("power, W")],bands:[{series:[1,2],fill:F(e.measured,.2)},{series:[4,5],fill:F(e.modelled,.16)}],series:[{},t,t,{stroke:e.measured,width:2.75,points:{show:!1}},t,t,{stroke:e.modelled,width:1,points:{show:!1}}]}}} data=${r} height=${270} changes=${[a.id]} onReady=${e=>{$.current[0]=e}} label="Battery power over the mission, measured and modelled, with the least and greatest of each span" />
<${R} make=${()=>{let e=h(),t={stroke:"transparent",points:{show:!1}};return{cursor:u,hooks:d,scales:{x:{time:!1}},axes:[c("time since the start"),E("speed, m/s")],bands:[{series:[1,2],fill:F(e.ink,.12)}],series:[{},t,t,{stroke:e.ink,width:1.5,points:{show:!1}}]}}} data=${o} height=${150} changes=${[a.id]} onReady=${e=>{$.current[1]=e}} label="Speed over the mission" /></div>`}function He({trace:e,mission:a,index:n}){let s=null!==n&&n<e.start_utime_us.length?n:null,l=(e,t)=>null===s?{n:"–",u:""}:t(e[s]),r=e.measured_power_w,o=e.modelled_power_w,i=null===s||null===r.mean[s]?null:r.mean[s]-o.mean[s];return t`<dl class="readouts strip" aria-live="off">
<${_} label="Time" of=${null===s?"–":ee((e.start_utime_us[s]-a.start_utime_us)/1e6)} />
<${_} label="Measured" channel="measured" of=${l(r.mean,V)} note=${null!==s&&null!==r.mean[s]?`${U(r.min[s],0)} to ${U(r.max[s],0)}`:""} />
<${_} label="Modelled" channel="modelled" of=${l(o.mean,V)} />
<${_} label="Gap" channel="gap" of=${(()=>{let e=V(i);return{n:H(e.n),u:e.u}})()} />
<${_} label="Speed" of=${l(e.speed_m_s.mean,e=>Z(e,"m/s",2))} />
<${_} label="Charge" of=${l(e.state_of_charge,e=>Y(e,2))} />
</dl>`}function qe(e,t){let a=Math.floor((t-e.start_utime_us[0])/e.width_us),n=Math.max(0,Math.min(a,e.start_utime_us.length-1));for(;n>0&&e.start_utime_us[n]>t;)n-=1;return n}function Ve({mission:e,whole:a,fine:n}){let[l,o]=O(null),[i,d]=O(null),[u,c]=O("power"),h=t=>Math.round(e.start_utime_us+1e6*t),$=r(null===l?null:`/v1/missions/${e.id}/trace${s({points:700,from_utime_us:h(l[0]),to_utime_us:h(l[1])})}`),m=null!==l&&null!==$.value&&$.value.start_utime_us.length>1?$.value:a,p=a.measured_power_w.mean.some(e=>null!==e),g=m===a?n:m,f=W(()=>g.x_m.map((e,t)=>{let a=g.measured_power_w.mean[t],n=g.modelled_power_w.mean[t];return[e??NaN,g.y_m[t]??NaN,"gap"===u?null===a?NaN:a-n:a??n??NaN]}),[g,u]),_=null===i||i>=m.start_utime_us.length?null:qe(g,m.start_utime_us[i]+m.width_us/2),v=f.some(([e])=>Number.isFinite(e));return 0===a.start_utime_us.length?t`<${k} title="Power"><${b} title="No trace kept">The mission ended before its first sample was stored.<//><//>`:t`<div class="columns trace-columns">
<${k} class="screen" title="Power and speed" aside=${t`
<span class="key"><span class="swatch measured"></span>measured <span class="swatch modelled"></span>modelled <span class="swatch band"></span>least to greatest</span>
${null===l?t`<span class="note">drag or press + to look closer</span>`:t`<button type="button" onClick=${()=>o(null)}>Whole mission</button>`}`}>
<${Ge} trace=${m} mission=${e} zoom=${l} set_zoom=${o} set_cursor=${d} />
<${He} trace=${m} mission=${e} index=${i} />
<p class="note foot">Each point is ${ee(m.width_us/1e6)}${null!==l?", closer view":""}.</p>
<//>
<${k} class="screen" title="On the floor" aside=${t`<${x} label="Colour by" value=${u} onChange=${c} options=${p?[["power","Power"],["gap","Gap"]]:[["power","Power"]]} />`}>
${v?t`<${Te} points=${f} kind=${u} cursor=${_} height=${440} label=${`Path of the mission, coloured by ${"gap"===u?"measured minus modelled power":"power"}; circle: start, square: end`} />
<p class="note foot">○ start  ■ end. Poses as the robot told them.</p>`:t`<${b} title="No poses">This robot did not tell where it was.<//>`}
<//>
</div>`}function Ke({mission:e,trace:a}){let s=r(`/v1/robots/${l(e.robot_id)}`),o=s.value?.model.idle_power_w,i=W(()=>void 0===o?null:function(e,t,a){let{distance_m:n,duration_s:s}=e.energy,{runs:l,stood_at_end_s:r}=function(e,t){let a=[],n=null,s=null,l=0;return e.speed_m_s.mean.forEach((r,o)=>{let i=Math.abs(r??0),[d,u]=[e.x_m[o],e.y_m[o]],c=e.covered_s[o]??0;if(i<=.02?(n=null,e.modelled_power_w.mean[o]<=1.05*t&&(l+=c)):(null===n&&(a.push(n={length_m:0,stood_s:l,first:NaN,last:NaN}),l=0),n.length_m+=i*c),null===d||null===u||(null===s&&(s=[d,u]),Math.hypot(d-s[0],u-s[1])<.05))return;let h=Math.atan2(u-s[1],d-s[0]),$=n??a[a.length-1];void 0!==$&&(Number.isNaN($.first)&&($.first=h),$.last=h),s=[d,u]}),{runs:a.filter(({length_m:e})=>e>=.05),stood_at_end_s:l}}(t,a);if(0===l.length||l.length>400||n<.05)return null;let o=l.reduce((e,t)=>e+t.length_m,0),i=e=>e>.2?[{kind:"dwell",duration_s:e}]:[];return{path:[...l.flatMap((e,t)=>{let a=0===t?NaN:function(e,t){let a=t-e;return Math.atan2(Math.sin(a),Math.cos(a))}(l[t-1].last,e.first);return[...i(e.stood_s),...Math.abs(a)>.02?[{kind:"turn",angle_rad:a}]:[],{kind:"straight",length_m:e.length_m/o*n}]}),...i(r)],payload_kg:e.payload_kg??0,deadline_s:s,columns:!1}}(e,a,o),[e.id,e.state,o]),[d,u]=O({value:null,error:null});D(()=>{if(null===i)return;let t=new AbortController;return n(`/v1/robots/${l(e.robot_id)}/profile`,i,t.signal).then(e=>u({value:e,error:null}),e=>"AbortError"===e.name||u({value:null,error:e})),()=>t.abort()},[i]);let c=null===s.value?s.error:d.error;if(null!==c)return t`<${y} error=${c} />`;if(null!==s.value&&null===i)return t`<${b} title="Nothing to compare">The robot did not drive, or in too many short runs.<//>`;if(null===d.value)return t`<${v} what="the minimum-energy drive" />`;let h=e.energy,$=d.value,m=1-$.energy_j/h.modelled_j,p=i.path.reduce((e,t)=>e+Math.abs(t.angle_rad??0),0),g=i.path.reduce((e,t)=>e+(t.duration_s??0),0),f=i.path.filter(e=>"straight"===e.kind).length;return t`
<p class="verdict">${m>.005?t`The same legs could have been driven for <b>${U(100*m,1)}${" "}%</b> less.`:m>-.005?"Driven about as cheaply as the model allows.":"Driven for less than these legs cost from stop to stop: the robot turned while it drove."}</p>
<${Be} label="Energy of the mission and of the minimum-energy drive" rows=${[{name:"Measured",value:h.measured_j,of:q(h.measured_j,4),channel:"measured",note:ee(h.duration_s)},{name:"Modelled",value:h.modelled_j,of:q(h.modelled_j,4),channel:"modelled",note:ee(h.duration_s)},{name:"Least energy",value:$.energy_j,of:q($.energy_j,4),channel:"least",note:ee($.duration_s)}]} />
<p class="note foot">${f} ${1===f?"leg":"legs"} between stops, ${Q(K(h.distance_m))} in all, ${U(180*p/Math.PI)}° turned at the stops,${g>0?` ${ee(g)} standing as the mission did,`:""}${" "}payload ${Q(Z(e.payload_kg??0,"kg"))}, arriving no later. Model version ${$.model_version}; the saving is against the modelled energy, so that a gap of the model does not count as one.</p>`}function Xe({mission:e}){let a=Object.entries(e.sample_faults),n=(e,a)=>t`<tr><th scope="row">${e}</th><td>${a}</td></tr>`,s=e.energy;return t`<table class="facts"><tbody>
${n("Robot",t`<a href=${m(e.robot_id)}>${e.robot_id}</a>`)}
${n("Started",ae(e.start_utime_us))}
${n("open"===e.state?"Last heard":"Ended",ae(e.end_utime_us))}
${n("Announced",e.implicit?"no: opened by its telemetry":"by the robot")}
${n("Model",null===e.model_version?"none":`version ${e.model_version}`)}
${n("Samples",U(e.samples))}
${n("Gaps",0===e.gap_count?"none":`${e.gap_count}, ${ee(e.gap_s)} in all`)}
${n("Faulty samples",0===a.length?"none":a.map(([e,t])=>`${t} ${se(e)}`).join(", "))}
${n("Battery measured",`${ee(s.measured_s)} of ${ee(s.duration_s)}`)}
${n("Drawn · returned",`${Q(q(s.drawn_j))} · ${Q(q(s.returned_j))}`)}
${n("Charge",Q(Z(1e3*s.charge_ah,"mAh")))}
${n("Motors measured",null===s.measured_motor_j[0]?"–":`right ${Q(q(s.measured_motor_j[0]))}, left ${Q(q(s.measured_motor_j[1]))}`)}
${n("Motors modelled",`right ${Q(q(s.modelled_motor_j[0]))}, left ${Q(q(s.modelled_motor_j[1]))}`)}
${e.note&&n("Note",e.note)}
</tbody></table>`}var Ye=Math.PI/180,Ze={straight:{name:"Straight",fields:{length:{label:"length",unit:"m",min:.01,start:5}}},turn:{name:"Turn in place",fields:{angle:{label:"angle, left positive",unit:"°",start:90}}},arc:{name:"Arc",fields:{radius:{label:"radius",unit:"m",min:.01,start:2},angle:{label:"angle, left positive",unit:"°",start:90}}},dwell:{name:"Dwell",fields:{duration:{label:"time",unit:"s",min:0,start:10}}},payload:{name:"Payload from here",fields:{mass:{label:"payload",unit:"kg",min:0,start:10}}}};function Qe(e){return{kind:e,...Object.fromEntries(Object.entries(Ze[e].fields).map(([e,t])=>[e,t.start]))}}function et(e){switch(e.kind){case"turn":return{kind:"turn",angle_rad:e.angle*Ye};case"arc":return{kind:"arc",radius_m:e.radius,angle_rad:e.angle*Ye};case"dwell":return{kind:"dwell",duration_s:e.duration};case"payload":return{kind:"payload",payload_kg:e.mass};default:return{kind:"straight",length_m:e.length}}}function tt(e){let[[t,a],n]=e;return{start_pose:{x_m:t,y_m:a,heading_rad:Math.atan2(n[1]-a,n[0]-t)},path:[{kind:"polyline",points:e.slice(1).map(([e,t])=>({x_m:e,y_m:t}))}]}}var at=.25,nt=e=>Math.round(e/at)*at;function st({points:e,change:a,height:n=400}){let[s,l]=O(16),[r,o]=O(null),i=z(null),d=z(null),u=e=>{let t=e.currentTarget.getBoundingClientRect();return[e.clientX-t.left,e.clientY-t.top]},c=e=>d.current.from(...e).map(nt),$=t=>{let n=e[e.length-1];(!n||n[0]!==t[0]||n[1]!==t[1])&&a([...e,t])},m=()=>{i.current=null};return t`<div class="draw">
<${je} draw=${(t,a,n)=>{let l=d.current=ye(a/s,0,0,a,n),o=h();if(ke(t,l),t.strokeStyle=t.fillStyle=o.accent,t.lineWidth=3,t.lineJoin="round",t.beginPath(),e.forEach(([e,a],n)=>t[0===n?"moveTo":"lineTo"](...l.to(e,a))),t.stroke(),e.forEach(([a,n],s)=>{t.beginPath(),t.arc(...l.to(a,n),5,0,7),t.fillStyle=s===e.length-1?o.accent:o.screen,t.fill(),t.stroke()}),e.length>0&&Me(t,l,e[0][0],e[0][1],e.length>1?Math.atan2(e[1][1]-e[0][1],e[1][0]-e[0][0]):0,o.ink),r){let[e,a]=l.to(...r);t.strokeStyle=o.ink,t.lineWidth=1,t.beginPath(),t.moveTo(e-12,a),t.lineTo(e+12,a),t.moveTo(e,a-12),t.lineTo(e,a+12),t.stroke()}xe(t,l)}} height=${n} changes=${[e,s,r]} role="application" tabindex="0"
label=${`Drawing of the path, ${e.length} points. Arrow keys move the cross, Enter adds a point, Backspace removes the last.${r?` Cross at ${G(r[0],3)}, ${G(r[1],3)} metres.`:""}`}
onPointerDown=${t=>{let a=u(t),n=(([t,a])=>e.findIndex(([e,n])=>{let[s,l]=d.current.to(e,n);return Math.hypot(t-s,a-l)<12}))(a);t.currentTarget.setPointerCapture(t.pointerId),n>=0?i.current=n:($(c(a)),i.current=e.length)}} onPointerMove=${t=>{if(null===i.current)return;let n=c(u(t)),s=e[i.current];s&&(s[0]!==n[0]||s[1]!==n[1])&&a(e.map((e,t)=>t===i.current?n:e))}} onPointerUp=${m} onPointerCancel=${m} onKeyDown=${t=>{let n=t.shiftKey?1:at,s={ArrowLeft:[-n,0],ArrowRight:[n,0],ArrowUp:[0,n],ArrowDown:[0,-n]}[t.key],l=r??e[e.length-1]??[0,0];if(s)o([l[0]+s[0],l[1]+s[1]]);else if("Enter"===t.key)$(l);else{if("Backspace"!==t.key&&"Delete"!==t.key)return;a(e.slice(0,-1))}t.preventDefault()}} />
<div class="tools"><button type="button" onClick=${()=>a(e.slice(0,-1))} disabled=${0===e.length}>Undo point</button>
<button type="button" onClick=${()=>a([])} disabled=${0===e.length}>Clear</button>
<button type="button" onClick=${()=>l(s/2)} disabled=${s<=4} aria-label="Closer">+</button>
<button type="button" onClick=${()=>l(2*s)} disabled=${s>=256} aria-label="Wider">−</button>
<span class="note">Press to add, drag to move; snaps to ${at} m. Corners are turned in place.</span></div>
</div>`}var lt=()=>[{kind:"straight",length:6},{kind:"turn",angle:90},{kind:"straight",length:4}];function rt({legs:e,change:a,fault:n}){let s=(t,n)=>{let s=[...e];[s[t],s[t+n]]=[s[t+n],s[t]],a(s)};return t`<fieldset class="legs"><legend>Legs</legend><ol>
${e.map((l,r)=>t`<li key=${r} class=${n===r?"faulty":""}>
<select aria-label=${`Kind of leg ${r+1}`} value=${l.kind} onChange=${t=>a(e.map((e,a)=>a===r?Qe(t.currentTarget.value):e))}>
${Object.entries(Ze).map(([e,{name:a}])=>t`<option key=${e} value=${e}>${a}</option>`)}</select>
<span class="leg-fields">${Object.entries(Ze[l.kind].fields).map(([n,s])=>t`<label key=${n} class="inline"><span class="hidden">${`Leg ${r+1}, ${s.label}`}</span>
<input type="number" step="any" min=${s.min} required title=${s.label} value=${l[n]} onInput=${t=>((t,n)=>a(e.map((e,a)=>a===t?{...e,...n}:e)))(r,{[n]:t.currentTarget.valueAsNumber})} /><span class="unit">${s.unit}</span></label>`)}</span>
<span class="leg-tools"><button type="button" class="plain" disabled=${0===r} aria-label=${`Move leg ${r+1} up`} onClick=${()=>s(r,-1)}>↑</button>
<button type="button" class="plain" disabled=${r===e.length-1} aria-label=${`Move leg ${r+1} down`} onClick=${()=>s(r,1)}>↓</button>
<button type="button" class="plain" disabled=${1===e.length} aria-label=${`Remove leg ${r+1}`} onClick=${()=>a(e.filter((e,t)=>t!==r))}>×</button></span></li>`)}
</ol><button type="button" onClick=${()=>a([...e,Qe("straight")])}>Add a leg</button></fieldset>`}function ot(e,t,a){if(!t)return e.map(()=>null);let n=t.time_s,s=t[a],l=1;return e.map(e=>{for(;l<n.length-1&&n[l]<e;)l+=1;let t=n[l]>n[l-1]?Math.max(0,Math.min(1,(e-n[l-1])/(n[l]-n[l-1]))):1;return s[l-1]+t*(s[l]-s[l-1])})}function it({answer:e}){let a=e.profile,n=a.yaw_rate_rad_s.some(e=>Math.abs(e)>1e-6),{trapezoid:s,triangle:l}=e.baselines,r=W(()=>[a.time_s,a.speed_m_s,ot(a.time_s,s?.profile,"speed_m_s"),ot(a.time_s,l?.profile,"speed_m_s"),n?a.yaw_rate_rad_s:a.time_s.map(()=>null)],[e]),o=W(()=>[a.time_s,a.power_w],[e]),i={sync:{key:"plan"},drag:{x:!1,y:!1}};return t`
<${R} make=${()=>{let e=h(),t={show:!1};return{cursor:i,scales:{x:{time:!1},yaw:{}},axes:[E("",{size:28}),E("speed, m/s"),...n?[E("yaw rate, rad/s",{scale:"yaw",side:1,grid:{show:!1}})]:[]],series:[{},{stroke:e.accent,width:2.25,points:t},{stroke:e.muted,width:1.25,dash:[6,4],points:t},{stroke:e.muted,width:1.25,dash:[2,3],points:t},{stroke:e.modelled,width:1.25,scale:n?"yaw":"y",points:t}]}}} data=${r} height=${210} changes=${[n]} label=${`Speed over ${ee(e.duration_s)}, greatest ${U(e.peak_speed_m_s,2)} metres a second`} />
<${R} make=${()=>{let e=h();return{cursor:i,scales:{x:{time:!1}},axes:[E("time, s",{size:28}),E("power, W"),...n?[E(" ",{scale:"y",side:1,grid:{show:!1},ticks:{show:!1},values:()=>[]})]:[]],series:[{},{stroke:e.accent,width:1.75,fill:F(e.accent,.12),points:{show:!1}}]}}} data=${o} height=${150} changes=${[n]} label="Battery power of the optimal profile over time" />
<p class="note foot"><span class="swatch accent"></span>least energy ${n&&t`<span class="swatch modelled"></span>yaw rate `}<span class="swatch dashed"></span>trapezoid <span class="swatch dotted"></span>triangle</p>`}function dt({answer:e,take:a}){let n=e.pareto,{trapezoid:s,triangle:l}=e.baselines,r=W(()=>{let t=[n,[e],[s],[l]].map(e=>new Map(e.filter(Boolean).map(e=>[e.duration_s,e.energy_j]))),a=[...new Set(t.flatMap(e=>[...e.keys()]))].sort((e,t)=>e-t);return[a,...t.map(e=>a.map(t=>e.get(t)??null))]},[e]),[o,i]=O(0),d=n[Math.min(o,n.length-1)];return t`<${R} make=${()=>{let e=h(),t=(e,t,a)=>({stroke:"transparent",paths:()=>null,points:{show:!0,size:t,width:2,stroke:e,fill:a}});return{scales:{x:{time:!1}},cursor:{y:!1,drag:{x:!1,y:!1},points:{show:!1}},axes:[E("duration, s",{size:28,space:70}),E("energy, J",{size:58})],series:[{},{stroke:e.modelled,width:1.5,spanGaps:!0,points:{show:!0,size:5,fill:e.modelled}},t(e.accent,12,e.accent),t(e.muted,9,e.screen),t(e.muted,9,e.muted)]}}} data=${r} height=${230} changes=${[]} label=${`Energy against duration, from ${ee(n[0].duration_s)} to ${ee(n[n.length-1].duration_s)}`} />
<p class="note foot"><span class="swatch accent dot"></span>this plan <span class="swatch hollow dot grey"></span>trapezoid <span class="swatch grey dot"></span>triangle <span class="swatch modelled"></span>front</p>
<div class="front-pick"><label><span>Walk the front</span><input type="range" min="0" max=${n.length-1} value=${o} onInput=${e=>i(e.currentTarget.valueAsNumber)} aria-valuetext=${`${ee(d.duration_s)}, ${Q(q(d.energy_j))}`} /></label>
<span class="number">${U(d.duration_s,2)} s · ${Q(q(d.energy_j,4))}; a second less costs ${ut(d.time_multiplier_w)}</span>
<button type="button" onClick=${()=>a(d)}>Take as deadline</button></div>`}var ut=e=>0!==e&&Math.abs(e)<.005?"less than 0.01 J":Q(q(e)),ct={closed_form:"formulas",interior_point:"an interior-point method",mixed:"formulas and an interior-point method"};function ht(e){if(!e)return"not possible here";let t=e.saving_fraction,a=Q(Y(Math.abs(t),1));return e.within_limits?t>=0?`we save ${a}`:`costs ${a} less`:`breaks the limits, and costs ${a} ${t>=0?"more":"less"}`}function $t({answer:e}){let a=e.certificate,n=(e,a)=>t`<tr><th scope="row">${e}</th><td>${a}</td></tr>`;return t`<table class="facts"><tbody>
${n("Found by",ct[a.method]??se(a.method))}
${n("At most above the optimum",ut(a.gap_j))}
${n("Error of the time steps",ut(a.discretisation_j))}
${n("A global optimum",a.convex?"yes: the problem is convex":"not proven: the problem is not convex")}
${n("A second less costs",ut(a.time_multiplier_w))}
${n("Limits met",0===a.binding.length?"none":a.binding.map(se).join(", "))}
${n("Braking",`${Q(q(e.braking_j))}, of which ${Q(q(e.recovered_j))} returns`)}
${n("Peak power",Q(V(e.peak_power_w)))}
${n("Model",`version ${e.model_version}`)}
</tbody></table>`}function mt({answer:e,autonomy:a}){if(null!==a.error)return t`<${y} error=${a.error} />`;if(null===a.value)return t`<p class="verdict open">The robot has not told its charge: enter it to see whether the robot makes it.</p>`;let n=a.value,s=n.usable_energy_j-e.energy_j,l=s>=0,r=n.state_of_charge-n.reserve_fraction,o=r>0?n.state_of_charge-r*e.energy_j/n.usable_energy_j:null,i=e.energy_j>0?Math.floor(n.usable_energy_j/e.energy_j):null;return t`<div class=${"verdict-box "+(l?"makes":"fails")}>
<p class="verdict"><b>${l?"The robot makes it":"The robot does not make it"}</b>${l?t`: arrives with ${Q(Y(o,o>.995?2:1))} charge, ${Q(q(s))} above its reserve of ${Q(Y(n.reserve_fraction))}.`:t`: ${Q(q(-s))} short of its reserve of ${Q(Y(n.reserve_fraction))}.`}</p>
<p class="note">Starts with ${Q(Y(n.state_of_charge,1))}, ${Q(q(n.usable_energy_j))} usable${i>=2?`: about ${U(Number(i.toPrecision(2)))} such drives`:""}. At its ${"model"===n.consumption.basis?"modelled":"recent"} consumption it has ${Q(K(n.range_m))} or ${ee(n.run_time_s)} left.</p></div>`}var pt={fleet:function(){S("Fleet");let e=i(),a=c(),[n,s]=O(""),[l,r]=O("all"),[o,d]=O({key:"robot",down:!1}),[u,h]=O(!1),$=[...e.robots.values()].filter(e=>ue(e.state)).length,m="all"===l&&""===n&&$>0&&$<e.robots.size,p=function(e,t,a,n){let s=z({key:"",at:-1/0,rows:[]}),l=`${t}|${a}|${n.key}|${n.down}|${e.robots.size}|${e.loads}`,r=performance.now();if(s.current.key!==l||r-s.current.at>3e3){let o=de.find(e=>e.key===n.key),i=function(e,t,a){let n=t.trim().toLowerCase(),s={all:()=>!0,heard:e=>!ue(e),live:e=>e.live,charging:e=>null!==e.charging,silent:e=>!e.live,mission:e=>null!==e.mission,low:e=>null!==e.state_of_charge&&e.state_of_charge<.25}[a];return[...e.values()].filter(e=>s(e.state)&&(""===n||e.id.toLowerCase().includes(n)||(e.state.mission?.mission_id??"").toLowerCase().includes(n)))}(e.robots,t,a).sort((e,t)=>ue(e.state)-ue(t.state)||(n.down?-1:1)*o.sort(e,t)||ie.compare(e.id,t.id));s.current={key:l,at:r,rows:i}}return s.current.rows}(e,n,m&&!u?"heard":l,o),[g,f,_]=function(e){let t=z(null),[a,n]=O([0,40]);return D(()=>{let a=()=>{if(null===t.current)return;let a=t.current.getBoundingClientRect().top,s=Math.max(0,Math.floor(-a/46)-8),l=Math.min(e,Math.ceil((innerHeight-a)/46)+8);n(e=>e[0]===s&&e[1]===l?e:[s,l])};return a(),addEventListener("scroll",a,{passive:!0}),addEventListener("resize",a),()=>{removeEventListener("scroll",a),removeEventListener("resize",a)}},[e]),[t,Math.min(a[0],e),Math.min(Math.max(a[1],0),e)]}(p.length);return e.loaded||0!==e.robots.size?0===e.robots.size?t`<h1>Fleet</h1><${b} title="No robot yet">A robot appears here when its telemetry arrives over LCM or its file is put to <code>/v1/robots/…</code>.<//>`:t`
<h1 class="hidden">Fleet</h1>
<${pe} robots=${e.robots} />
<div class="tools">
<label class="find"><span class="hidden">Find a robot or mission</span><input type="search" placeholder="Find a robot or mission" value=${n} onInput=${e=>s(e.currentTarget.value)} /></label>
<${x} label="Show" value=${l} onChange=${r} options=${[["all","All"],["live","Live"],["silent","Silent"],["mission","On a mission"],["charging","Charging"],["low","Low charge"]]} />
<span class="key"><span class="swatch measured"></span>measured <span class="swatch modelled"></span>modelled</span>
</div>
<table class="grid fleet" aria-rowcount=${p.length+1}>
<thead><tr>${de.map(e=>t`<th key=${e.key} scope="col" class=${e.class} aria-sort=${(e=>e.key!==o.key?void 0:o.down?"descending":"ascending")(e)}>
${e.sort?t`<button type="button" onClick=${()=>(e=>d(t=>({key:e,down:t.key===e&&!t.down})))(e.key)}>${e.title}<span class="arrow" aria-hidden="true">${e.key===o.key?o.down?"▾":"▴":""}</span></button>`:e.title}</th>`)}</tr></thead>
<tbody ref=${g}>
${f>0&&t`<tr key="above" aria-hidden="true" class="spacer"><td colspan=${de.length} style=${{height:46*f+"px"}}></td></tr>`}
${p.slice(f,_).map((e,n)=>t`<${me} key=${e.id} entry=${e} revision=${e.revision} index=${f+n} dark=${a} />`)}
${_<p.length&&t`<tr key="below" aria-hidden="true" class="spacer"><td colspan=${de.length} style=${{height:46*(p.length-_)+"px"}}></td></tr>`}
</tbody>
</table>
${0===p.length&&t`<${b} title="No robot matches" />`}
${m&&t`<p class="fold"><button type="button" class="plain" aria-expanded=${String(u)} onClick=${()=>h(!u)}>${u?"Hide":"Show"} ${$} ${1===$?"robot":"robots"} not heard since the service started</button></p>`}`:null!==e.error?t`<${y} error=${e.error} />`:t`<${v} what="the fleet" />`},robots:function({id:e}){S(e);let a=i(),n=c(),o=r(`/v1/robots/${l(e)}`),d=r(`/v1/missions${s({robot_id:e,limit:12})}`),u=a.robots.get(e),h=u?.state,$=h?.mission?.id;return D(()=>{null!==d.value&&d.reload()},[$]),!h&&a.loaded&&404===o.error?.status?t`<${b} title=${`There is no robot ${e}`}>See the <a href="#/fleet">fleet</a>.<//>`:t`
<div class="heading"><p class="crumbs"><a href="#/fleet">Fleet</a></p><h1>${e}</h1>
${h&&t`<span class="health"><${ce} state=${h} /></span>`}
<span class="spring"></span><a class="button" href=${`#/plan${s({robot:e})}`}>Plan a drive</a></div>
${h&&null===h.silent_s&&t`<p class="note">Nothing was heard of it since the service started. What is kept of it stands below.</p>`}
${h&&null!==h.silent_s&&t`<dl class="readouts">
<${_} large label=${null===h.measured_power_w?"Power (modelled)":"Power"} of=${V(h.measured_power_w??h.modelled_power_w)} channel=${null===h.measured_power_w?"modelled":"measured"} note=${t`<${le} track=${u.power} revision=${u.revision} dark=${n} width=${120} height=${26} />`} />
<${_} large label="Charge" of=${Y(h.state_of_charge)} note=${[null===h.state_of_charge?"":he(h).text,null===h.battery_voltage_v?"":Q(Z(h.battery_voltage_v,"V",2))].filter(Boolean).join(" · ")} />
<${_} large label="Range" of=${K(h.range_m)} note=${re(h.range_quantiles_m,X)} />
<${_} large label="Run time" of=${te(h.run_time_s)} note=${re(h.run_time_quantiles_s,(e,t)=>`${te(e)} – ${te(t)}`)} />
${null===h.charging&&J(h.charge.time_to_charged_s)&&t`<${_} large label="To charge" of=${te(h.charge.time_to_charged_s)} note="if it went now" />`}
<${_} large label="Speed" of=${Z(h.speed_m_s,"m/s",2)} />
<${_} large label="Payload" of=${Z(h.payload_kg,"kg")} />
<${_} large label="Windings, right · left" of=${null===h.winding_temperature_c[0]?"–":`${U(h.winding_temperature_c[0])} · ${U(h.winding_temperature_c[1])} °C`} />
<${_} large label="Mission" of=${q(h.mission?.energy.battery_j)} note=${h.mission?t`<a href=${p(h.mission.id)}>${h.mission.mission_id}</a>`:"none running"} />
</dl>`}
${(h||o.value)&&t`<${_e} part="RobotHistory" id=${e} />`}
<${k} title="Recent missions" aside=${t`<a href=${`#/missions${s({robot:e})}`}>All missions of ${e}</a>`}><${w} of=${d} what="missions">${e=>0===e.missions.length?t`<${b} title="No mission yet" />`:t`<div class="scroll"><${Ae} missions=${e.missions} with_robot=${!1} /></div>`}<//><//>
<div class="columns">
<${k} class="screen" title="On the floor now">${u?t`<${We} entry=${u} />`:t`<${b} title="Never heard" />`}<//>
<${k} title="Model">${o.value?t`<${Fe} model=${o.value.model} />`:t`<p class="note">none</p>`}<//>
</div>`},missions:function({given:e}){S("Missions");let[a,n]=O(e),[l,o]=O([""]),i=z(JSON.stringify(e));D(()=>{JSON.stringify(e)!==i.current&&(i.current=JSON.stringify(e),n(e),o([""]))},[e]);let d=W(()=>Ee(a),[a]),u=l[l.length-1],c=r(`/v1/missions${s({...d,limit:50,cursor:u})}`),h=r(`/v1/mission-totals${s(d)}`);return t`
<h1 class="hidden">Missions</h1>
<${Le} given=${a} change=${e=>{let t=Object.fromEntries(Object.entries(e).filter(([,e])=>""!==e));i.current=JSON.stringify(t),n(t),o([""]),g("missions",t)}} />
<${Re} told=${h} />
<div class="tools"><button type="button" onClick=${()=>{c.reload(),h.reload()}}>Refresh</button>
<span class="note">Times are local (${Intl.DateTimeFormat().resolvedOptions().timeZone})</span>
<${ze} given=${a} total=${h.value?.missions??0} /></div>
<${w} of=${c} what="missions">${({missions:e,next_cursor:n})=>t`
${c.error&&t`<${y} error=${c.error} retry=${c.reload} />`}
<div class=${c.loading?"stale":""} aria-busy=${String(c.loading)}>
${0===e.length?t`<${b} title=${Object.keys(a).length>0?"No mission matches":"No mission yet"}>Missions appear when a robot announces one or sends telemetry.<//>`:t`<div class="scroll"><${Ae} missions=${e} /></div>`}
</div>
${e.length>0&&t`<nav class="pages" aria-label="Pages of missions">
<button type="button" disabled=${1===l.length} onClick=${()=>o(l.slice(0,-1))}>Newer</button>
<span>${U(50*(l.length-1)+1)} – ${U(50*(l.length-1)+e.length)}${h.value?` of ${U(h.value.missions)}`:""}</span>
<button type="button" disabled=${null===n} onClick=${()=>o([...l,n])}>Older</button>
</nav>`}`}<//>`},mission:function({id:e}){let a=r(`/v1/missions/${l(e)}`),n=null!==a.value,o=r(n?`/v1/missions/${l(e)}/ledger`:null),i=r(n?`/v1/missions/${l(e)}/trace${s({points:700})}`:null),d=null!==i.value&&i.value.start_utime_us.length>=350,u=r(d?`/v1/missions/${l(e)}/trace${s({points:6e3})}`:null),c=d?u.value:i.value;S(a.value?.mission_id??"Mission");let h="open"===a.value?.state;return D(()=>{if(!h)return;let e=setInterval(()=>[a,o,i].forEach(e=>e.reload()),3e3);return()=>clearInterval(e)},[h]),!n&&[400,404].includes(a.error?.status)?t`<${b} title=${`There is no mission ${e}`}>No mission of this history has that number. See <a href="#/missions">all missions</a>.<//>`:t`<${w} of=${a} what="the mission">${e=>{let a=e.energy,n=Oe(a);return t`
<div class="heading"><p class="crumbs"><a href="#/missions">Missions</a> / <a href=${m(e.robot_id)}>${e.robot_id}</a></p>
<h1>${e.mission_id}</h1><${j} mission=${e} />
${e.incomplete&&t`<span class="flag">incomplete${e.incomplete_reason?`: ${se(e.incomplete_reason)}`:""}</span>`}
<span class="note">${ae(e.start_utime_us)}</span></div>
<dl class="readouts">
<${_} large label=${null===a.measured_j?"From the battery (modelled)":"From the battery"} of=${q(a.battery_j)} channel=${null===a.measured_j?"modelled":"measured"} />
<${_} large label="Modelled" of=${q(a.modelled_j)} channel="modelled" />
<${_} large label="Unexplained" of=${(()=>{let e=q(a.unexplained_j);return{n:H(e.n),u:e.u}})()} channel="gap" note=${null===n?"":`ratio ${U(n,3)}`} />
<${_} large label="Distance" of=${K(a.distance_m)} />
<${_} large label="Duration" of=${ee(a.duration_s)} />
<${_} large label="Per metre" of=${Z(a.distance_m>.1?a.battery_j/a.distance_m:null,"J/m")} />
<${_} large label="Payload" of=${Z(e.payload_kg,"kg")} />
</dl>
<${w} of=${i} what="the trace">${a=>t`<${Ve} mission=${e} whole=${a} fine=${c??a} />`}<//>
<div class="columns">
<${k} title="Where the energy went"><${w} of=${o} what="the ledger">${({ledger:e})=>t`<${Ie} terms_j=${e.terms_j} battery_j=${e.battery_j} closure=${e.closure_relative} />`}<//><//>
<div>
<${k} title="Against the minimum-energy drive">${null===e.model_version?t`<${b} title="No model">The robot had no model on this mission.<//>`:h?t`<${b} title="Still driving">Compared when the mission ends.<//>`:e.gap_s>0?t`<${b} title="Not compared">For ${ee(e.gap_s)} of the mission nothing is known.<//>`:c&&t`<${Ke} mission=${e} trace=${c} />`}<//>
<${k} title="Record"><${Xe} mission=${e} /><//>
</div>
</div>`}}<//>`},plan:function({given:e}){S("Plan");let a=i(),s=[...a.robots.values()].filter(e=>e.state.has_model).map(e=>e.id).sort(),[r,o]=O(e.robot??""),[d,u]=O("legs"),[c,h]=O(lt),[$,m]=O([[-5,-2],[2,-2],[2,2.5],[5,2.5]]),[p,f]=O({payload:"",deadline:"",value:"",charge:""}),[w,M]=O({answer:null,error:null,busy:!1,autonomy:{value:null,error:null}}),j=z(null),T=C(s),N=s.includes(r)?r:s[0]??"",P=W(()=>"legs"===d?function(e){let[t,a,n]=[0,0,0],s=[[t,a]];for(let l of e)if("straight"===l.kind)t+=l.length*Math.cos(n),a+=l.length*Math.sin(n),s.push([t,a]);else if("turn"===l.kind)n+=l.angle*Ye;else if("arc"===l.kind){let e=l.angle<0?-1:1,r=Math.max(2,Math.ceil(Math.abs(l.angle)/5)),o=t-e*l.radius*Math.sin(n),i=a+e*l.radius*Math.cos(n);for(let t=1;t<=r;++t){let a=n+l.angle*Ye*t/r;s.push([o+e*l.radius*Math.sin(a),i-e*l.radius*Math.cos(a)])}n+=l.angle*Ye,[t,a]=s[s.length-1]}return s}(c).filter(([e,t])=>Number.isFinite(e+t)):$,[d,c,$]),E=W(()=>w.answer?.profile.x_m.map((e,t)=>[e,w.answer.profile.y_m[t],w.answer.profile.power_w[t]]),[w.answer]),A=async(e={})=>{let t={...p,...e},s=e=>""===e?void 0:Number(e);if("draw"===d&&$.length<2)return void M(e=>({...e,error:Object.assign(new Error("Draw at least two points."),{title:"No path yet"})}));j.current?.abort();let r=j.current=new AbortController;M(e=>({...e,busy:!0,error:null}));let o={..."draw"===d?tt($):{path:c.map(et)},payload_kg:s(t.payload),deadline_s:s(t.deadline),value_of_time_w:s(t.value),pareto_points:24,baseline_columns:!0},i=s(t.charge),u=`/v1/robots/${l(N)}`,h=void 0!==i||null!==a.robots.get(N)?.state.state_of_charge?n(`${u}/autonomy`,{state_of_charge:void 0===i?void 0:i/100,payload_kg:o.payload_kg},r.signal).then(e=>({value:e,error:null}),e=>({value:null,error:e})):{value:null,error:null};try{let e=await n(`${u}/profile`,o,r.signal);M({answer:e,of:P,error:null,busy:!1,autonomy:await h})}catch(e){"AbortError"!==e.name&&M(t=>({...t,error:e,busy:!1}))}};if(D(()=>(""!==N&&A(),()=>j.current?.abort()),[N]),a.loaded&&0===s.length)return t`<h1>Plan</h1><${b} title="No robot has a model">Put a robot file to <code>/v1/robots/…</code> to plan with it.<//>`;if(!a.loaded)return t`<${v} what="the fleet" />`;let L=(e,a,n,s)=>t`<label class="field"><span>${a}</span><span class="with-unit"><input type="number" step="any" min="0" value=${p[e]} onInput=${t=>f({...p,[e]:t.currentTarget.value})} ...${s} /><span class="unit">${n}</span></span></label>`,R=w.answer,F=/^\/path\/(\d+)/.exec(w.error?.field??""),B=R?.baselines;return t`<h1 class="hidden">Plan</h1><div class="plan">
<form class="plan-form" onSubmit=${e=>{e.preventDefault(),A()}}>
<label class="field"><span>Robot</span><select value=${N} onChange=${e=>{o(e.currentTarget.value),g("plan",{robot:e.currentTarget.value})}}>${T}</select></label>
<${x} label="How to give the path" value=${d} onChange=${u} options=${[["legs","Enter legs"],["draw","Draw"]]} />
${"legs"===d?t`<${rt} legs=${c} change=${h} fault=${F?Number(F[1]):null} />`:t`<p class="note">${$.length} points, ${Q(K($.slice(1).reduce((e,[t,a],n)=>e+Math.hypot(t-$[n][0],a-$[n][1]),0)))}. Draw on the floor.</p>`}
<div class="terms">
${L("payload","Payload","kg",{placeholder:"0"})}
${L("deadline","Deadline","s",{placeholder:"free"})}
${L("value","Value of time","W",{placeholder:"0"})}
${L("charge","Charge now","%",{placeholder:"live",max:100})}
</div>
<button type="submit" class="primary" disabled=${""===N}>${w.busy?"Computing …":"Compute"}</button>
</form>
<div class="plan-result" aria-live="polite" aria-busy=${String(w.busy)}>
${w.error&&t`<${y} error=${w.error} />`}
${"draw"===d&&t`<${k} class="screen" title="Draw the path"><${st} points=${$} change=${m} /><//>`}
${null===R?null===w.error&&t`<${v} what="the plan" />`:t`<div class=${w.busy?"stale":""}>
<${mt} answer=${R} autonomy=${w.autonomy} />
<dl class="readouts">
<${_} large label="Least energy" of=${q(R.energy_j)} channel="accent" />
<${_} large label="Duration" of=${ee(R.duration_s)} />
<${_} large label="Distance" of=${K(R.distance_m)} />
<${_} large label="Top speed" of=${Z(R.peak_speed_m_s,"m/s",2)} />
<${_} large label="Per metre" of=${Z(R.distance_m>0?R.energy_j/R.distance_m:null,"J/m")} />
</dl>
<div class="columns">
<div>
<${k} class="screen" title="Speed and power"><${it} answer=${R} /><//>
<${k} title="Against the usual profiles">
<${Be} label="Energy of the plan, a trapezoid and a triangle in the same time" rows=${[{name:"Least energy",value:R.energy_j,of:q(R.energy_j,4),channel:"least",note:""},...["trapezoid","triangle"].map(e=>({name:e[0].toUpperCase()+e.slice(1),value:B[e]?.energy_j??null,of:q(B[e]?.energy_j,4),channel:"plain",note:ht(B[e])}))]} />
<p class="note foot">All three in the same time on every run between stops.</p>
<//>
<${k} title="Where the energy goes"><${Ie} terms_j=${R.ledger_j} battery_j=${R.energy_j} measured=${!1} /><//>
</div>
<div>
<${k} class="screen" title="On the floor"><${Te} points=${E} under=${w.of===P?null:P} height=${340} label="The planned path, coloured by power; circle: start, square: end" /><//>
<${k} class="screen" title="Energy against time">${R.pareto.length<2?t`<${b} title="No front">Nothing to trade: time and energy do not compete on this path.<//>`:t`<${dt} answer=${R} take=${({duration_s:e})=>{let t=String(Math.ceil(100*e)/100);f({...p,deadline:t}),A({deadline:t})}} />`}<//>
<${k} title="How sure the optimum is"><${$t} answer=${R} /><//>
</div>
</div></div>`}
${"legs"===d&&null===R&&P.length>1&&t`<${k} class="screen" title="Path"><${Te} points=${P.map(([e,t])=>[e,t,NaN])} legend=${!1} label="The path that was entered" /><//>`}
</div></div>`},gap:e=>t`<${_e} part="Gap" ...${e} />`};function gt(){let e=i(),a={live:"Live",connecting:"Connecting",offline:"Offline"}[e.link];return t`<span class=${`link ${e.link}`} role="status"><span class="lamp" aria-hidden="true"></span>${a}</span>`}function ft(){let e=i(),[a,n]=O(!1);if(D(()=>{if(n(!1),"offline"!==e.link)return;let t=setTimeout(()=>n(!0),1500);return()=>clearTimeout(t)},[e.link]),!a)return null;let s=ne(1e3*e.since_ms);return t`<div class="banner" role="alert">No connection to the service since ${s}. What is shown is as of then; trying again.</div>`}o(),P(t`<${function(){let[a,n]=O($(location.hash)),s=z(null),l=z(!0),r=c();D(()=>{let e=()=>n($(location.hash));return addEventListener("hashchange",e),()=>removeEventListener("hashchange",e)},[]),D(()=>{l.current?l.current=!1:(scrollTo(0,0),s.current.focus({preventScroll:!0}))},[a.view,a.id]);let o=pt[a.view],i={robots:"fleet",mission:"missions"}[a.view]??a.view,d=(e,a)=>t`<a href=${`#/${e}`} aria-current=${i===e?"page":void 0}>${a}</a>`;return t`
<a class="skip" href="#main" onClick=${e=>{e.preventDefault(),s.current.focus()}}>Skip to content</a>
<header class="top">
<a class="mark" href="#/fleet" aria-label="joulecast, fleet">
<svg viewBox="0 0 32 20" width="38" height="24" aria-hidden="true"><path d="M1 14h6l4-12 6 17 4-10 2 5h8" /></svg>joulecast</a>
<nav aria-label="Views">${d("fleet","Fleet")}${d("missions","Missions")}${d("plan","Plan")}${d("gap","Gap")}</nav>
<${gt} />
<button type="button" class="theme" onClick=${u} aria-label=${r?"Light theme":"Dark theme"} title=${r?"Light theme":"Dark theme"}>
<svg viewBox="0 0 20 20" width="18" height="18" aria-hidden="true"><circle cx="10" cy="10" r="7.5" class="ring" /><path d="M10 2.5a7.5 7.5 0 0 1 0 15z" /></svg></button>
</header>
<${ft} />
<main id="main" tabindex="-1" ref=${s}>
<${e} view=${location.hash}>
${o?t`<${o} key=${`${a.view}/${a.id??""}`} id=${a.id} given=${a.given} />`:t`<${b} title="There is no such page">Go to the <a href="#/fleet">fleet</a>.<//>`}
<//>
</main>`}} />`,document.getElementById("app"));
