/* joulecast operator page, built from source/; licences: third_party.txt */
import{$ as e,A as t,B as a,C as n,E as s,F as l,G as o,H as r,I as i,J as d,K as u,L as c,M as h,N as $,O as m,P as p,Q as g,R as f,S as _,T as b,U as v,V as y,W as w,X as k,Y as x,Z as M,_ as j,a as T,aa as C,b as N,ba as S,c as P,ca as E,d as O,e as A,ea as D,f as L,fa as R,g as z,ga as F,h as W,ha as B,i as J,j as I,k as U,l as G,m as H,n as q,o as V,p as K,s as X,t as Y,u as Z,v as Q,w as ee,x as te,y as ae,z as ne}from"./base.js";var se=class extends N{canvas=T();shouldComponentUpdate(e){return e.revision!==this.props.revision||e.dark!==this.props.dark||e.track!==this.props.track}componentDidMount(){this.draw()}componentDidUpdate(){this.draw()}draw(){let e=this.canvas.current,{width:t=128,height:a=30,track:n}=this.props,s=devicePixelRatio||1,l=e.getContext("2d"),o=h();e.width!==t*s&&(e.width=t*s,e.height=a*s),l.setTransform(s,0,0,s,0,0),l.clearRect(0,0,t,a),l.strokeStyle=o.graticule,l.lineWidth=1,l.beginPath();for(let e=t-.5;e>0;e-=32)l.moveTo(e,0),l.lineTo(e,a);let r=n.last(),i=1,d=0;for(let[,e,t]of r)e>i&&(i=e),t>i&&(i=t),e<d&&(d=e);let u=e=>a-2-(e-d)/(i-d)*(a-5);if(l.moveTo(0,Math.round(u(0))+.5),l.lineTo(t,Math.round(u(0))+.5),l.stroke(),r.length<2)return;let c=r[r.length-1][0];for(let[e,a,n]of[[2,o.modelled,1],[1,o.measured,1.5]]){l.strokeStyle=a,l.lineWidth=n,l.lineJoin="round",l.beginPath();let s=-1/0;for(let a of r){let n=t-2-(c-a[0])/9e7*t;Number.isFinite(a[e])&&(a[0]-s>5e6?l.moveTo(n,u(a[e])):l.lineTo(n,u(a[e])),s=a[0])}l.stroke()}}render(){let{width:e=128,height:a=30}=this.props;return t`<canvas class="sparkline" ref=${this.canvas} style=${{width:`${e}px`,height:`${a}px`}} aria-hidden="true"></canvas>`}};function le(e,a){return J(e?.p05)&&J(e.p95)?t`<span title="nine times of ten"><span class="hidden">90 % between </span>${a(e.p05,e.p95)}</span>`:""}var oe=e=>(t,a)=>{let n=e(t.state),s=e(a.state);return(null==n)-(null==s)||(n<s?-1:n>s?1:0)},re=new Intl.Collator("en",{numeric:!0}),ie=[{key:"robot",title:"Robot",sort:(e,t)=>re.compare(e.id,t.id),class:"robot"},{key:"health",title:"Telemetry",sort:oe(e=>e.live?0:null===e.silent_s?1/0:1+e.silent_s),class:"health"},{key:"power",title:"Power",sort:oe(e=>e.measured_power_w??e.modelled_power_w),class:"figure power"},{key:"trace",title:"Last 90 s",class:"spark"},{key:"charge",title:"Charge",sort:oe(e=>e.state_of_charge),class:"charge"},{key:"range",title:"Range",sort:oe(e=>e.range_m),class:"figure range"},{key:"time",title:"Run time",sort:oe(e=>e.run_time_s),class:"figure wide"},{key:"speed",title:"Speed",sort:oe(e=>e.speed_m_s),class:"figure wide"},{key:"mission",title:"Mission",sort:oe(e=>e.mission?.start_utime_us),class:"mission"},{key:"spent",title:"Spent",sort:oe(e=>e.mission?.energy.battery_j),class:"figure spent"}],de=e=>null===e.silent_s;function ue({state:e}){let{level:a,text:n,faults:s}=function(e){let t=Object.values(e.faults).reduce((e,t)=>e+t,0);return e.has_model?e.live?{level:"good",text:"live",faults:t}:de(e)?{level:"none",text:"not heard",faults:t}:{level:"bad",text:`silent ${Q(e.silent_s)}`,faults:t}:{level:"bad",text:"no model",faults:t}}(e),l=Object.entries(e.faults).map(([e,t])=>`${t} ${ne(e)}`).join(", ");return t`<span class=${`lamp ${a}`} aria-hidden="true"></span>${n}
${s>0&&t`<span class="note" title=${l}> · ${I(s)} faulty</span>`}`}function ce({charging:e,charge:t,state_of_charge_sd:a}){let n=t?.time_to_charged_s;return"full"===e?.phase?{text:"charged",what:"At its charger, which has ended"}:e?{text:"charging"+(J(n)?`, ${ee(n)}`:""),what:"At its charger"+(J(n)?`, ready in ${ee(n)}`:"")}:{text:J(a)?`± ${Z(X(a))}`:"",what:"standard deviation"}}function he({state:e}){let a=e.state_of_charge;if(null===a)return t`<span class="note">unknown</span>`;let{text:n,what:s}=ce(e);return t`<span class=${"charge-bar "+(e.charging?"charging":a<.25?"low":"")} aria-hidden="true"><span style=${{width:`${Math.max(2,100*a)}%`}}></span></span>
<${f} of=${X(a)} /><span class="below" title=${s}>${n}</span>`}var $e=class extends N{shouldComponentUpdate(e){return e.revision!==this.props.revision||e.entry!==this.props.entry||e.index!==this.props.index||e.dark!==this.props.dark}render({entry:e,index:a,revision:n,dark:s}){let l=e.state,o=null===l.measured_power_w;return t`<tr aria-rowindex=${a+2} class=${l.live?"":"quiet"}>
<th scope="row" class="robot"><a href=${m(e.id)}>${e.id}</a></th>
<td class="health"><${ue} state=${l} /></td>
<td class="figure power"><${f} of=${q(l.measured_power_w??l.modelled_power_w)} />${o&&null!==l.modelled_power_w&&t`<span class="note"> mod.</span>`}</td>
<td class="spark"><${se} track=${e.power} revision=${n} dark=${s} /></td>
<td class="charge"><${he} state=${l} /></td>
<td class="figure range"><${f} of=${V(l.range_m)} /><span class="below">${le(l.range_quantiles_m,K)}</span></td>
<td class="figure wide">${ee(l.run_time_s)}</td>
<td class="figure wide"><${f} of=${Y(l.speed_m_s,"m/s",2)} /></td>
<td class="mission">${l.mission?t`<a href=${p(l.mission.id)} title=${l.mission.mission_id}>${((e,t)=>e.startsWith(`${t}-`)?e.slice(t.length+1):e)(l.mission.mission_id,e.id)}</a>`:t`<span class="note">idle</span>`}</td>
<td class="figure spent"><${f} of=${H(l.mission?.energy.battery_j)} /></td>
</tr>`}};function me({robots:e}){let[a,n,s,l,o,r,i,d]=[0,0,0,0,null,!1,0,0];for(let{state:t}of e.values()){let e=t.measured_power_w??t.modelled_power_w;t.live&&(n+=1,null!==t.charging?(i+=1,d-=Math.min(0,t.measured_power_w??0)):null!==e&&(a+=e,r=!0)),null!==t.mission&&(s+=1,l+=t.mission.energy.battery_j),null!==t.state_of_charge&&(null===o||t.state_of_charge<o.state_of_charge)&&(o=t)}return t`<dl class="readouts">
<${_} large label="Fleet power" of=${r?q(a):{n:"–",u:""}} channel="measured" />
<${_} large label="Live" of=${`${n}`} note=${`of ${e.size}`} />
<${_} large label="On a mission" of=${`${s}`} />
<${_} large label="Spent in running missions" of=${H(s>0?l:null)} />
${i>0&&t`<${_} large label="Charging" of=${`${i}`} note=${`at ${Z(q(d))}`} />`}
<${_} large label="Lowest charge" of=${X(o?.state_of_charge)} note=${o&&t`<a href=${m(o.robot_id)}>${o.robot_id}</a>`} />
</dl>`}var pe=null,ge=null;function fe({part:e,...a}){let[,n]=O(0),[s,l]=O(null),o=()=>n(e=>e+1),r=()=>{l(null),document.getElementById("gap-style")||document.head.append(Object.assign(document.createElement("link"),{id:"gap-style",rel:"stylesheet",href:"gap-style.css"})),(pe??=import("./gap.js").then(e=>{ge=e},e=>{throw pe=null,e}),pe).then(o,()=>l({status:0,title:"This part of the page could not be loaded",message:"The service may be restarting, or the network is down."}))};if(A(()=>{null===ge&&r()},[]),null!==s)return t`<${y} error=${s} retry=${r} />`;if(null===ge)return t`<${v} what="this part of the page" />`;let i=ge[e];return t`<${i} ...${a} />`}var _e={light:[[200,206,196],[226,178,92],[212,104,44],[150,38,48],[72,14,52]],dark:[[44,58,62],[104,72,104],[196,82,72],[250,152,56],[255,238,170]]},be={light:[[20,84,140],[120,170,200],[196,196,190],[226,140,100],[172,36,34]],dark:[[70,170,255],[60,106,150],[78,84,84],[176,92,64],[255,120,84]]};function ve(e,t,a,n,s){return{scale:e,width:n,height:s,to:(l,o)=>[n/2+(l-t)*e,s/2-(o-a)*e],from:(l,o)=>[t+(l-n/2)/e,a-(o-s/2)/e]}}function ye(e){let t=10**Math.floor(Math.log10(e));return[5,2,1].map(e=>e*t).find(t=>t<=e)??t}function we(e,t){let a=h(),n=ye(90/t.scale),[s,l]=t.from(0,0),[o,r]=t.from(t.width,t.height);e.strokeStyle=a.graticule,e.lineWidth=1,e.beginPath();for(let a=Math.ceil(s/n)*n;a<=o;a+=n){let n=Math.round(t.to(a,0)[0])+.5;e.moveTo(n,0),e.lineTo(n,t.height)}for(let a=Math.ceil(r/n)*n;a<=l;a+=n){let n=Math.round(t.to(0,a)[1])+.5;e.moveTo(0,n),e.lineTo(t.width,n)}e.stroke()}function ke(e,t){let a=h(),n=ye(120/t.scale),s=n*t.scale,l=14.5,o=t.height-14.5;e.strokeStyle=e.fillStyle=a.ink,e.lineWidth=1.5,e.beginPath(),e.moveTo(l,o-5),e.lineTo(l,o),e.lineTo(l+s,o),e.lineTo(l+s,o-5),e.stroke(),e.font='12px "Liberation Sans", "Helvetica Neue", Arial, sans-serif',e.textAlign="left",e.textBaseline="alphabetic",e.fillText(`${U(n,1)} m`,l+s+6,o)}function xe(e,t,a,n,s,l){let[o,r]=t.to(a,n);e.save(),e.translate(o,r),e.rotate(-s),e.fillStyle=l,e.strokeStyle=h().screen,e.lineWidth=2,e.beginPath(),e.moveTo(11,0),e.lineTo(-7,7),e.lineTo(-3.5,0),e.lineTo(-7,-7),e.closePath(),e.stroke(),e.fill(),e.restore()}function Me({draw:e,height:a,label:n,changes:s,...l}){let o=z(null),r=z(e),i=c();r.current=e;let d=()=>{let e=o.current,t=devicePixelRatio||1,n=e?.clientWidth??0;if(0===n)return;(e.width!==Math.round(n*t)||e.height!==Math.round(a*t))&&(e.width=Math.round(n*t),e.height=Math.round(a*t));let s=e.getContext("2d");s.setTransform(t,0,0,t,0,0),s.clearRect(0,0,n,a),r.current(s,n,a)};return L(()=>{let e=new ResizeObserver(d);return e.observe(o.current),()=>e.disconnect()},[a]),A(d,[i,...s]),t`<canvas class="floor" role="img" aria-label=${n} ref=${o} style=${{height:`${a}px`}} ...${l}></canvas>`}function je({points:e,kind:a="power",height:n=380,label:s,cursor:l=null,robot:o=null,legend:r=!0,ends:i=!0,under:u=null}){let $=e.filter(([e,t])=>Number.isFinite(e)&&Number.isFinite(t)),m=c(),p=function(e,t){let a=t.filter(Number.isFinite).map(t=>"gap"===e?Math.abs(t):t).sort((e,t)=>e-t),n=Math.max(a.length>0?a[Math.floor(.98*(a.length-1))]:1,.001),s=10**Math.floor(Math.log10(n))/2,l=Math.ceil(n/s)*s,o="gap"===e?-l:0,r=function(e){let t=[];for(let a=0;a<64;++a){let n=a/63*(e.length-1),s=Math.min(Math.floor(n),e.length-2),l=n-s,o=e[s].map((t,a)=>Math.round(t+(e[s+1][a]-t)*l));t.push(`rgb(${o.join(" ")})`)}return t}(("gap"===e?be:_e)[d()?"dark":"light"]);return{low:o,high:l,colours:r,colour_of:e=>r[Math.max(0,Math.min(63,Math.round((e-o)/(l-o)*63)))]}}(a,$.map(e=>e[2]));return t`<div class="floor-box">
<${Me} draw=${(t,a,n)=>{let s=function(e,t,a,n=28,s=2){let[l,o,r,i]=[1/0,-1/0,1/0,-1/0];for(let[t,a]of e)!Number.isFinite(t)||!Number.isFinite(a)||(l=Math.min(l,t),o=Math.max(o,t),r=Math.min(r,a),i=Math.max(i,a));return l>o&&([l,o,r,i]=[-s,s,-s,s]),ve(Math.min((t-2*n)/Math.max(o-l,s),(a-2*n)/Math.max(i-r,s)),(l+o)/2,(r+i)/2,t,a)}([...$,...o?[o]:[],...u??[]],a,n,34);we(t,s),null!==u&&function(e,t,a){e.strokeStyle=h().muted,e.lineWidth=1.25,e.setLineDash([5,4]),e.beginPath(),a.forEach(([a,n],s)=>e[0===s?"moveTo":"lineTo"](...t.to(a,n))),e.stroke(),e.setLineDash([])}(t,s,u),t.lineWidth=3.2,t.lineCap="round",t.lineJoin="round";let r=null;for(let e=1;e<$.length;++e){let a=$[e][2],n=Number.isFinite(a)?p.colour_of(a):h().line;n!==r&&(null!==r&&t.stroke(),t.strokeStyle=r=n,t.beginPath(),t.moveTo(...s.to($[e-1][0],$[e-1][1]))),t.lineTo(...s.to($[e][0],$[e][1]))}null!==r&&t.stroke(),$.length>1&&i&&function(e,t,a){let n=h(),s=a[0],l=a[a.length-1];e.lineWidth=2,e.strokeStyle=n.ink,e.fillStyle=n.screen;let[o,r]=t.to(s[0],s[1]);e.beginPath(),e.arc(o,r,5,0,7),e.fill(),e.stroke();let[i,d]=t.to(l[0],l[1]);e.fillStyle=n.ink,e.fillRect(i-4.5,d-4.5,9,9)}(t,s,$),o&&xe(t,s,o[0],o[1],o[2]??0,h().ink);let d=null===l?null:e[l];if(d&&Number.isFinite(d[0])){let[e,l]=s.to(d[0],d[1]);t.strokeStyle=h().ink,t.lineWidth=1,t.beginPath(),t.moveTo(e,0),t.lineTo(e,n),t.moveTo(0,l),t.lineTo(a,l),t.stroke(),t.fillStyle=h().accent,t.beginPath(),t.arc(e,l,6,0,7),t.fill(),t.stroke()}ke(t,s)}} height=${n} label=${s} changes=${[e,a,l,o,u]} />
${r&&$.some(e=>e[2]>0||"gap"===a)&&t`<${Te} scale=${p} dark=${m} title=${"gap"===a?"measured − modelled":"power"} />`}
</div>`}function Te({scale:e,title:a,unit:n="W"}){let s=(e.low+e.high)/2;return t`<div class="legend">
<span class="legend-title">${a}</span>
<span class="number">${U(e.low,2)}</span>
<${Me} draw=${(t,a,n)=>{let s=a/e.colours.length;e.colours.forEach((e,a)=>{t.fillStyle=e,t.fillRect(a*s,0,s+1,n)})}} height=${10} label=${`Colours from ${e.low} to ${e.high} ${n}`} changes=${[e.low,e.high,a]} />
<span class="number">${U(e.high,2)}${" "}${n}</span>
${"power"!==a&&t`<span class="note">neutral at ${U(s,1)}</span>`}
</div>`}var Ce={id:e=>e.id,robot_id:e=>e.robot_id,mission_id:e=>e.mission_id,state:e=>e.state,incomplete:e=>e.incomplete,incomplete_reason:e=>e.incomplete_reason,start_utime_us:e=>e.start_utime_us,end_utime_us:e=>e.end_utime_us,payload_kg:e=>e.payload_kg,model_version:e=>e.model_version,battery_j:e=>e.energy.battery_j,measured_j:e=>e.energy.measured_j,measured_s:e=>e.energy.measured_s,modelled_j:e=>e.energy.modelled_j,unexplained_j:e=>e.energy.unexplained_j,drawn_j:e=>e.energy.drawn_j,returned_j:e=>e.energy.returned_j,charge_ah:e=>e.energy.charge_ah,distance_m:e=>e.energy.distance_m,turned_rad:e=>e.energy.turned_rad,duration_s:e=>e.energy.duration_s,samples:e=>e.samples,gap_count:e=>e.gap_count,gap_s:e=>e.gap_s,note:e=>e.note},Ne=e=>`${Object.values(Ce).map(t=>function(e){if(null==e)return"";if("string"!=typeof e)return String(e);let t=/^[=+\-@\t\r]/.test(e)?`'${e}`:e;return/[",\r\n]/.test(t)?`"${t.replaceAll('"','""')}"`:t}(t(e))).join(",")}\r\n`,Se=e=>e?1e3*new Date(e).getTime():void 0;function Pe(e){return{robot_id:e.robot,mission_id:e.name,state:e.state,incomplete:e.incomplete,from_utime_us:Se(e.from),to_utime_us:Se(e.to),payload_min_kg:e.payload_min,payload_max_kg:e.payload_max}}var Ee=({measured_j:e,modelled_j:t})=>null!==e&&0!==t?e/t:null;function Oe({missions:e,with_robot:a=!0}){return t`<table class="grid missions">
<thead><tr>
<th scope="col">Started</th>${a&&t`<th scope="col">Robot</th>`}<th scope="col">Mission</th><th scope="col">State</th>
<th scope="col" class="figure">Duration</th><th scope="col" class="figure">Distance</th><th scope="col" class="figure wide">Payload</th>
<th scope="col" class="figure">Energy</th><th scope="col" class="figure wide">Modelled</th>
<th scope="col" class="figure"><abbr title="measured over modelled energy">Ratio</abbr></th><th scope="col" class="figure wide">Per metre</th>
</tr></thead>
<tbody>${e.map(e=>t`<tr key=${e.id}>
<td class="when">${te(e.start_utime_us)}</td>
${a&&t`<td><a href=${m(e.robot_id)}>${e.robot_id}</a></td>`}
<th scope="row"><a href=${p(e.id)}>${e.mission_id}</a></th>
<td><${j} mission=${e} />${e.incomplete&&t` <span class="flag" title=${e.incomplete_reason??""}>incomplete</span>`}</td>
<td class="figure">${Q(e.energy.duration_s)}</td>
<td class="figure"><${f} of=${V(e.energy.distance_m)} /></td>
<td class="figure wide"><${f} of=${Y(e.payload_kg,"kg")} /></td>
<td class="figure"><${f} of=${H(e.energy.battery_j)} /></td>
<td class="figure wide"><${f} of=${H(e.energy.modelled_j)} /></td>
<td class="figure"><${Ae} value=${Ee(e.energy)} /></td>
<td class="figure wide"><${f} of=${e.energy.distance_m>.1?Y(e.energy.battery_j/e.energy.distance_m,"J/m"):Y(null)} /></td>
</tr>`)}</tbody>
</table>`}function Ae({value:e}){return t`<span class=${J(e)&&Math.abs(e-1)>.1?"ratio off":"ratio"}>${I(e,3)}</span>`}function De({given:e,change:a}){let n=[...i().robots.keys()].sort(),s=t=>n=>a({...e,[t]:n.currentTarget.value}),l=(e,a)=>t`<label class="field"><span>${e}</span>${a}</label>`,o=Object.values(e).some(e=>""!==e&&void 0!==e);return t`<form class="filters" aria-label="Filter missions" onSubmit=${e=>e.preventDefault()}>
${l("Robot",t`<select value=${e.robot??""} onChange=${s("robot")}><option value="">all</option>
${e.robot&&!n.includes(e.robot)&&t`<option value=${e.robot}>${e.robot}</option>`}
${n.map(e=>t`<option key=${e} value=${e}>${e}</option>`)}</select>`)}
${l("From",t`<input type="datetime-local" value=${e.from??""} onChange=${s("from")} />`)}
${l("To",t`<input type="datetime-local" value=${e.to??""} onChange=${s("to")} />`)}
<fieldset class="field"><legend>Payload, kg</legend><span class="with-unit">
<input class="short" type="number" min="0" step="any" aria-label="Payload, from kg" placeholder="from" value=${e.payload_min??""} onChange=${s("payload_min")} />
<input class="short" type="number" min="0" step="any" aria-label="Payload, to kg" placeholder="to" value=${e.payload_max??""} onChange=${s("payload_max")} /></span></fieldset>
${l("State",t`<select value=${e.state??""} onChange=${s("state")}><option value="">all</option>${Object.entries(M).map(([e,a])=>t`<option key=${e} value=${e}>${a}</option>`)}</select>`)}
${l("Record",t`<select value=${e.incomplete??""} onChange=${s("incomplete")}><option value="">all</option><option value="false">complete</option><option value="true">incomplete</option></select>`)}
${l("Named",t`<input type="text" value=${e.name??""} onChange=${s("name")} />`)}
<button type="button" class="plain" disabled=${!o} onClick=${()=>a({})}>Clear</button>
</form>`}function Le({told:e}){return t`<${w} of=${e} what="totals">${e=>{let a=e.energy,n=e.missions>0;return t`<dl class="readouts">
<${_} label="Missions" of=${I(e.missions)} note=${e.incomplete_missions>0?`${I(e.incomplete_missions)} incomplete`:""} />
<${_} label="Energy from the batteries" of=${H(n?a.battery_j:null)} channel="measured" />
<${_} label="Modelled" of=${H(n?a.modelled_j:null)} channel="modelled" />
<${_} label="Unexplained" of=${H(a.unexplained_j)} channel="gap" note=${null!==a.unexplained_j&&0!==a.battery_j?`${I(100*a.unexplained_j/a.battery_j,1)} %`:""} />
<${_} label="Distance" of=${V(a.distance_m)} />
<${_} label="Per metre" of=${Y(a.distance_m>0?a.battery_j/a.distance_m:null,"J/m")} />
<${_} label="Duration" of=${Q(a.duration_s)} />
</dl>`}}<//>`}function Re({given:e,total:n}){let[l,o]=O(null),[r,i]=O(null),d=z(null);A(()=>()=>d.current?.abort(),[]);let u=async t=>{d.current=new AbortController,i(null),o(0);try{await async function(e,t,n,l){let o,r=["csv"===e?`${Object.keys(Ce).join(",")}\r\n`:"[\n"],i=0;do{let d=await a(`/v1/missions${s({...t,limit:1e3,cursor:o})}`,l);d.missions.length>0&&("csv"===e?r.push(d.missions.map(Ne).join("")):r.push((i>0?",\n":"")+d.missions.map(e=>JSON.stringify(e)).join(",\n"))),i+=d.missions.length,o=d.next_cursor,n(i)}while(null!==o);"json"===e&&r.push("\n]\n"),function(e,t,a){let n=URL.createObjectURL(new Blob(e,{type:a})),s=Object.assign(document.createElement("a"),{href:n,download:t});document.body.append(s),s.click(),s.remove(),setTimeout(()=>URL.revokeObjectURL(n),6e4)}(r,`joulecast-missions-${(new Date).toISOString().slice(0,19).replaceAll(":","")}.${e}`,"csv"===e?"text/csv":"application/json")}(t,Pe(e),o,d.current.signal)}catch(e){"AbortError"!==e.name&&i(e)}o(null)};return null!==l?t`<div class="export" role="status">
<progress max=${n||1} value=${l}></progress> ${I(l)} of ${I(n)}
<button type="button" onClick=${()=>d.current.abort()}>Stop</button></div>`:t`<div class="export">${r&&t`<span class="fault" role="alert">${r.message}</span>`}
<button type="button" disabled=${!n} onClick=${()=>u("csv")}>Export CSV</button>
<button type="button" disabled=${!n} onClick=${()=>u("json")}>Export JSON</button></div>`}function ze({model:e}){return t`<details class="model"><summary>Parameters in force</summary>
<table class="facts"><tbody>${Object.entries(B(e)).filter(([e])=>"robot_id"!==e).map(([e,a])=>t`<tr key=${e}><th scope="row"><code>${e}</code></th><td>${a}</td></tr>`)}</tbody></table></details>`}function Fe({entry:e}){let a=e.state.mission?.id,n=o(a?`/v1/missions/${a}/trace?points=600`:null),[s]=O({mission:null,rows:[]});s.mission!==a&&Object.assign(s,{mission:a,rows:[]});let l=e.path.last(),r=[...a&&n.value&&n.value.id===a?n.value.x_m.map((e,t)=>[e??NaN,n.value.y_m[t]??NaN,n.value.measured_power_w.mean[t]??n.value.modelled_power_w.mean[t]??NaN]):[],...l.map(([e,t,,a])=>[e,t,a])],[i,d,u]=e.state.pose;return 0===r.length||null===i?t`<${b} title="No position">${null===e.state.silent_s?"Nothing heard yet.":"This robot does not tell where it is."}<//>`:t`<${je} points=${r} height=${340} ends=${!1} robot=${[i,d,u??0]} label=${`Path of ${e.id} so far, coloured by power, and where it is now`} />`}function We({rows:e,label:a}){let n=Math.max(...e.map(e=>e.value??0),1e-9);return t`<table class="bars" aria-label=${a}><tbody>${e.map(e=>t`<tr key=${e.name}>
<th scope="row">${e.name}</th>
<td class="bar-cell"><svg width="100%" height="18" aria-hidden="true" focusable="false"><rect class=${`account ${e.channel}`} x="0" y="3" height="12" width=${100*Math.max(0,e.value??0)/n+"%"} /></svg></td>
<td class="figure"><${f} of=${e.of} /></td>
<td class="note">${e.note}</td></tr>`)}</tbody></table>`}var Be={accessories:"Idle and accessories",driver:"Motor drivers",copper:"Copper",brush:"Brushes",friction_internal:"Friction in motors and gears",friction_rolling:"Rolling",friction_scrub:"Scrub in turns",friction_zone:"Floor zones",friction_slip:"Wheel slip",drag:"Air",kinetic:"Change of motion",potential:"Change of height",braking:"Generated in braking",recovered:"Recovered",sensor:"Sensor fault",unexplained:"Unexplained"};function Je({terms_j:e,battery_j:a,closure:n,measured:s=!0}){let{rows:l,sum:o,absent:r}=function(e,t){let a=e=>Math.abs(e)<=1e-5*Math.abs(t),n=[],s=0;for(let[t,l]of Object.entries(e)){let e="recovered"===t?-l:l;"unexplained"===t&&n.push({key:"modelled",name:"Modelled",from:0,to:s,total:!0}),a(l)&&"unexplained"!==t||n.push({key:t,name:Be[t]??ne(t),from:s,to:s+e,change:e}),s+=e}return{rows:n,sum:s,absent:Object.entries(e).filter(([e,t])=>a(t)&&"unexplained"!==e).map(([e])=>(Be[e]??e).toLowerCase())}}(e,a),i=s?l:l.filter(e=>"unexplained"!==e.key&&"modelled"!==e.key),d=i.flatMap(e=>[e.from,e.to]).concat(a,0),u=Math.min(...d),c=Math.max(...d),h=Math.max(c-u,1e-9),$=e=>(e-u)/h*100,m=[...i,{key:"battery",name:s?"From the battery":"Total",from:0,to:a,total:!0}];return t`<div class="waterfall">
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
<td class="figure"><${f} of=${H(n)} sign=${!e.total} /></td>
<td class="figure share">${0!==a?I(100*n/a,1):"–"}${" "}%</td>
</tr>`})}
</tbody>
</table>
<p class="closing">
Accounts add up to <b>${I(o,2)}${" "}J</b>; the battery gave <b>${I(a,2)}${" "}J</b>.
${void 0!==n&&t` ${n<1e-9?"Closes":"Does not close"}: difference ${0===n?"none":n.toExponential(1)} of the whole.`}
${r.length>0&&t` <span class="note">Next to nothing in: ${r.join(", ")}.</span>`}
</p>
</div>`}var Ie=(e,t)=>t.map(e=>{if(null===e)return"";let t=e<0?"−":"",a=Math.abs(e),n=e=>String(Math.floor(e)).padStart(2,"0");return a<3600?`${t}${Math.floor(a/60)}:${n(a%60)}`:`${t}${Math.floor(a/3600)}:${n(a%3600/60)}:${n(a%60)}`});function Ue({trace:e,mission:a,zoom:n,set_zoom:s,set_cursor:l}){let[o,r]=W(()=>{let t=(...t)=>function(e,t,a){let n=function(e,t){return e.start_utime_us.map(a=>(a-t+e.width_us/2)/1e6)}(e,t),s=[];for(let t=1;t<n.length;++t)e.start_utime_us[t]-e.start_utime_us[t-1]>1.9*e.width_us&&s.push(t);if(0===s.length)return[n,...a];let l=(e,t)=>{let a=[];return e.forEach((n,l)=>{s.includes(l)&&a.push(void 0===t?(e[l-1]+n)/2:t),a.push(n)}),a};return[l(n),...a.map(e=>l(e,null))]}(e,a.start_utime_us,t.flatMap(e=>[e.max,e.min,e.mean]));return[t(e.measured_power_w,e.modelled_power_w),t(e.speed_m_s)]},[e]),i=z(e);i.current=e;let d={setCursor:[e=>l(null===e.cursor.idx||void 0===e.cursor.idx?null:He(i.current,a.start_utime_us+1e6*e.data[0][e.cursor.idx]))],setSelect:[e=>{e.select.width<6||(s([e.posToVal(e.select.left,"x"),e.posToVal(e.select.left+e.select.width,"x")]),e.setSelect({left:0,top:0,width:0,height:0},!1))}]},u={...F("mission"),drag:{x:!0,y:!1,setScale:!1,dist:6},bind:{dblclick:()=>()=>s(null)}},c=e=>S(e,{size:28,incrs:E,values:Ie}),$=z([]),m=z(0);return t`<div class="charts" tabindex="0" role="group" aria-label="Power and speed over time. Left and right move the cursor, plus looks closer, minus shows the whole mission." onKeyDown=${e=>{let t=$.current[0].data[0],a=Math.max(1,Math.round(t.length/20)),n=e.shiftKey?a:1,l={ArrowLeft:m.current-n,ArrowRight:m.current+n,Home:0,End:t.length-1}[e.key],o=t[t.length-1]-t[0],r=t[Math.min(m.current,t.length-1)];if(void 0!==l){m.current=Math.max(0,Math.min(t.length-1,l));for(let e of $.current)e.setCursor({left:e.valToPos(t[m.current],"x"),top:8})}else if("+"===e.key&&o>4)s([Math.max(t[0],r-o/4),Math.min(t[t.length-1],r+o/4)]);else{if("-"!==e.key&&"Escape"!==e.key)return;s(null)}e.preventDefault()}}>
<${D} make=${()=>{let e=h(),t={show:!0,stroke:"transparent",points:{show:!1}};return{cursor:u,hooks:d,scales:{x:{time:!1}},axes:[c(""),S("power, W")],bands:[{series:[1,2],fill:R(e.measured,.2)},{series:[4,5],fill:R(e.modelled,.16)}],series:[{},t,t,{stroke:e.measured,width:2.75,points:{show:!1}},t,t,{stroke:e.modelled,width:1,points:{show:!1}}]}}} data=${o} height=${270} changes=${[a.id]} onReady=${e=>{$.current[0]=e}} label="Battery power over the mission, measured and modelled, with the least and greatest of each span" />
<${D} make=${()=>{let e=h(),t={stroke:"transparent",points:{show:!1}};return{cursor:u,hooks:d,scales:{x:{time:!1}},axes:[c("time since the start"),S("speed, m/s")],bands:[{series:[1,2],fill:R(e.ink,.12)}],series:[{},t,t,{stroke:e.ink,width:1.5,points:{show:!1}}]}}} data=${r} height=${150} changes=${[a.id]} onReady=${e=>{$.current[1]=e}} label="Speed over the mission" /></div>`}function Ge({trace:e,mission:a,index:n}){let s=null!==n&&n<e.start_utime_us.length?n:null,l=(e,t)=>null===s?{n:"–",u:""}:t(e[s]),o=e.measured_power_w,r=e.modelled_power_w,i=null===s||null===o.mean[s]?null:o.mean[s]-r.mean[s];return t`<dl class="readouts strip" aria-live="off">
<${_} label="Time" of=${null===s?"–":Q((e.start_utime_us[s]-a.start_utime_us)/1e6)} />
<${_} label="Measured" channel="measured" of=${l(o.mean,q)} note=${null!==s&&null!==o.mean[s]?`${I(o.min[s],0)} to ${I(o.max[s],0)}`:""} />
<${_} label="Modelled" channel="modelled" of=${l(r.mean,q)} />
<${_} label="Gap" channel="gap" of=${(()=>{let e=q(i);return{n:G(e.n),u:e.u}})()} />
<${_} label="Speed" of=${l(e.speed_m_s.mean,e=>Y(e,"m/s",2))} />
<${_} label="Charge" of=${l(e.state_of_charge,e=>X(e,2))} />
</dl>`}function He(e,t){let a=Math.floor((t-e.start_utime_us[0])/e.width_us),n=Math.max(0,Math.min(a,e.start_utime_us.length-1));for(;n>0&&e.start_utime_us[n]>t;)n-=1;return n}function qe({mission:e,whole:a,fine:n}){let[l,r]=O(null),[i,d]=O(null),[u,c]=O("power"),h=t=>Math.round(e.start_utime_us+1e6*t),$=o(null===l?null:`/v1/missions/${e.id}/trace${s({points:700,from_utime_us:h(l[0]),to_utime_us:h(l[1])})}`),m=null!==l&&null!==$.value&&$.value.start_utime_us.length>1?$.value:a,p=a.measured_power_w.mean.some(e=>null!==e),g=m===a?n:m,f=W(()=>g.x_m.map((e,t)=>{let a=g.measured_power_w.mean[t],n=g.modelled_power_w.mean[t];return[e??NaN,g.y_m[t]??NaN,"gap"===u?null===a?NaN:a-n:a??n??NaN]}),[g,u]),_=null===i||i>=m.start_utime_us.length?null:He(g,m.start_utime_us[i]+m.width_us/2),v=f.some(([e])=>Number.isFinite(e));return 0===a.start_utime_us.length?t`<${k} title="Power"><${b} title="No trace kept">The mission ended before its first sample was stored.<//><//>`:t`<div class="columns trace-columns">
<${k} class="screen" title="Power and speed" aside=${t`
<span class="key"><span class="swatch measured"></span>measured <span class="swatch modelled"></span>modelled <span class="swatch band"></span>least to greatest</span>
${null===l?t`<span class="note">drag or press + to look closer</span>`:t`<button type="button" onClick=${()=>r(null)}>Whole mission</button>`}`}>
<${Ue} trace=${m} mission=${e} zoom=${l} set_zoom=${r} set_cursor=${d} />
<${Ge} trace=${m} mission=${e} index=${i} />
<p class="note foot">Each point is ${Q(m.width_us/1e6)}${null!==l?", closer view":""}.</p>
<//>
<${k} class="screen" title="On the floor" aside=${t`<${x} label="Colour by" value=${u} onChange=${c} options=${p?[["power","Power"],["gap","Gap"]]:[["power","Power"]]} />`}>
${v?t`<${je} points=${f} kind=${u} cursor=${_} height=${440} label=${`Path of the mission, coloured by ${"gap"===u?"measured minus modelled power":"power"}; circle: start, square: end`} />
<p class="note foot">○ start  ■ end. Poses as the robot told them.</p>`:t`<${b} title="No poses">This robot did not tell where it was.<//>`}
<//>
</div>`}function Ve({mission:e,trace:a}){let s=o(`/v1/robots/${l(e.robot_id)}`),r=s.value?.model.idle_power_w,i=W(()=>void 0===r?null:function(e,t,a){let{distance_m:n,duration_s:s}=e.energy,{runs:l,stood_at_end_s:o}=function(e,t){let a=[],n=null,s=null,l=0;return e.speed_m_s.mean.forEach((o,r)=>{let i=Math.abs(o??0),[d,u]=[e.x_m[r],e.y_m[r]],c=e.covered_s[r]??0;if(i<=.02?(n=null,e.modelled_power_w.mean[r]<=1.05*t&&(l+=c)):(null===n&&(a.push(n={length_m:0,stood_s:l,first:NaN,last:NaN}),l=0),n.length_m+=i*c),null===d||null===u||(null===s&&(s=[d,u]),Math.hypot(d-s[0],u-s[1])<.05))return;let h=Math.atan2(u-s[1],d-s[0]),$=n??a[a.length-1];void 0!==$&&(Number.isNaN($.first)&&($.first=h),$.last=h),s=[d,u]}),{runs:a.filter(({length_m:e})=>e>=.05),stood_at_end_s:l}}(t,a);if(0===l.length||l.length>400||n<.05)return null;let r=l.reduce((e,t)=>e+t.length_m,0),i=e=>e>.2?[{kind:"dwell",duration_s:e}]:[];return{path:[...l.flatMap((e,t)=>{let a=0===t?NaN:function(e,t){let a=t-e;return Math.atan2(Math.sin(a),Math.cos(a))}(l[t-1].last,e.first);return[...i(e.stood_s),...Math.abs(a)>.02?[{kind:"turn",angle_rad:a}]:[],{kind:"straight",length_m:e.length_m/r*n}]}),...i(o)],payload_kg:e.payload_kg??0,deadline_s:s,columns:!1}}(e,a,r),[e.id,e.state,r]),[d,u]=O({value:null,error:null});A(()=>{if(null===i)return;let t=new AbortController;return n(`/v1/robots/${l(e.robot_id)}/profile`,i,t.signal).then(e=>u({value:e,error:null}),e=>"AbortError"===e.name||u({value:null,error:e})),()=>t.abort()},[i]);let c=null===s.value?s.error:d.error;if(null!==c)return t`<${y} error=${c} />`;if(null!==s.value&&null===i)return t`<${b} title="Nothing to compare">The robot did not drive, or in too many short runs.<//>`;if(null===d.value)return t`<${v} what="the minimum-energy drive" />`;let h=e.energy,$=d.value,m=1-$.energy_j/h.modelled_j,p=i.path.reduce((e,t)=>e+Math.abs(t.angle_rad??0),0),g=i.path.reduce((e,t)=>e+(t.duration_s??0),0),f=i.path.filter(e=>"straight"===e.kind).length;return t`
<p class="verdict">${m>.005?t`The same legs could have been driven for <b>${I(100*m,1)}${" "}%</b> less.`:m>-.005?"Driven about as cheaply as the model allows.":"Driven for less than these legs cost from stop to stop: the robot turned while it drove."}</p>
<${We} label="Energy of the mission and of the minimum-energy drive" rows=${[{name:"Measured",value:h.measured_j,of:H(h.measured_j,4),channel:"measured",note:Q(h.duration_s)},{name:"Modelled",value:h.modelled_j,of:H(h.modelled_j,4),channel:"modelled",note:Q(h.duration_s)},{name:"Least energy",value:$.energy_j,of:H($.energy_j,4),channel:"least",note:Q($.duration_s)}]} />
<p class="note foot">${f} ${1===f?"leg":"legs"} between stops, ${Z(V(h.distance_m))} in all, ${I(180*p/Math.PI)}° turned at the stops,${g>0?` ${Q(g)} standing as the mission did,`:""}${" "}payload ${Z(Y(e.payload_kg??0,"kg"))}, arriving no later. Model version ${$.model_version}; the saving is against the modelled energy, so that a gap of the model does not count as one.</p>`}function Ke({mission:e}){let a=Object.entries(e.sample_faults),n=(e,a)=>t`<tr><th scope="row">${e}</th><td>${a}</td></tr>`,s=e.energy;return t`<table class="facts"><tbody>
${n("Robot",t`<a href=${m(e.robot_id)}>${e.robot_id}</a>`)}
${n("Started",te(e.start_utime_us))}
${n("open"===e.state?"Last heard":"Ended",te(e.end_utime_us))}
${n("Announced",e.implicit?"no: opened by its telemetry":"by the robot")}
${n("Model",null===e.model_version?"none":`version ${e.model_version}`)}
${n("Samples",I(e.samples))}
${n("Gaps",0===e.gap_count?"none":`${e.gap_count}, ${Q(e.gap_s)} in all`)}
${n("Faulty samples",0===a.length?"none":a.map(([e,t])=>`${t} ${ne(e)}`).join(", "))}
${n("Battery measured",`${Q(s.measured_s)} of ${Q(s.duration_s)}`)}
${n("Drawn · returned",`${Z(H(s.drawn_j))} · ${Z(H(s.returned_j))}`)}
${n("Charge",Z(Y(1e3*s.charge_ah,"mAh")))}
${n("Motors measured",null===s.measured_motor_j[0]?"–":`right ${Z(H(s.measured_motor_j[0]))}, left ${Z(H(s.measured_motor_j[1]))}`)}
${n("Motors modelled",`right ${Z(H(s.modelled_motor_j[0]))}, left ${Z(H(s.modelled_motor_j[1]))}`)}
${e.note&&n("Note",e.note)}
</tbody></table>`}var Xe=Math.PI/180,Ye={straight:{name:"Straight",fields:{length:{label:"length",unit:"m",min:.01,start:5}}},turn:{name:"Turn in place",fields:{angle:{label:"angle, left positive",unit:"°",start:90}}},arc:{name:"Arc",fields:{radius:{label:"radius",unit:"m",min:.01,start:2},angle:{label:"angle, left positive",unit:"°",start:90}}},dwell:{name:"Dwell",fields:{duration:{label:"time",unit:"s",min:0,start:10}}},payload:{name:"Payload from here",fields:{mass:{label:"payload",unit:"kg",min:0,start:10}}}};function Ze(e){return{kind:e,...Object.fromEntries(Object.entries(Ye[e].fields).map(([e,t])=>[e,t.start]))}}function Qe(e){switch(e.kind){case"turn":return{kind:"turn",angle_rad:e.angle*Xe};case"arc":return{kind:"arc",radius_m:e.radius,angle_rad:e.angle*Xe};case"dwell":return{kind:"dwell",duration_s:e.duration};case"payload":return{kind:"payload",payload_kg:e.mass};default:return{kind:"straight",length_m:e.length}}}function et(e){let[[t,a],n]=e;return{start_pose:{x_m:t,y_m:a,heading_rad:Math.atan2(n[1]-a,n[0]-t)},path:[{kind:"polyline",points:e.slice(1).map(([e,t])=>({x_m:e,y_m:t}))}]}}var tt=.25,at=e=>Math.round(e/tt)*tt;function nt({points:e,change:a,height:n=400}){let[s,l]=O(16),[o,r]=O(null),i=z(null),d=z(null),u=e=>{let t=e.currentTarget.getBoundingClientRect();return[e.clientX-t.left,e.clientY-t.top]},c=e=>d.current.from(...e).map(at),$=t=>{let n=e[e.length-1];(!n||n[0]!==t[0]||n[1]!==t[1])&&a([...e,t])},m=()=>{i.current=null};return t`<div class="draw">
<${Me} draw=${(t,a,n)=>{let l=d.current=ve(a/s,0,0,a,n),r=h();if(we(t,l),t.strokeStyle=t.fillStyle=r.accent,t.lineWidth=3,t.lineJoin="round",t.beginPath(),e.forEach(([e,a],n)=>t[0===n?"moveTo":"lineTo"](...l.to(e,a))),t.stroke(),e.forEach(([a,n],s)=>{t.beginPath(),t.arc(...l.to(a,n),5,0,7),t.fillStyle=s===e.length-1?r.accent:r.screen,t.fill(),t.stroke()}),e.length>0&&xe(t,l,e[0][0],e[0][1],e.length>1?Math.atan2(e[1][1]-e[0][1],e[1][0]-e[0][0]):0,r.ink),o){let[e,a]=l.to(...o);t.strokeStyle=r.ink,t.lineWidth=1,t.beginPath(),t.moveTo(e-12,a),t.lineTo(e+12,a),t.moveTo(e,a-12),t.lineTo(e,a+12),t.stroke()}ke(t,l)}} height=${n} changes=${[e,s,o]} role="application" tabindex="0"
label=${`Drawing of the path, ${e.length} points. Arrow keys move the cross, Enter adds a point, Backspace removes the last.${o?` Cross at ${U(o[0],3)}, ${U(o[1],3)} metres.`:""}`}
onPointerDown=${t=>{let a=u(t),n=(([t,a])=>e.findIndex(([e,n])=>{let[s,l]=d.current.to(e,n);return Math.hypot(t-s,a-l)<12}))(a);t.currentTarget.setPointerCapture(t.pointerId),n>=0?i.current=n:($(c(a)),i.current=e.length)}} onPointerMove=${t=>{if(null===i.current)return;let n=c(u(t)),s=e[i.current];s&&(s[0]!==n[0]||s[1]!==n[1])&&a(e.map((e,t)=>t===i.current?n:e))}} onPointerUp=${m} onPointerCancel=${m} onKeyDown=${t=>{let n=t.shiftKey?1:tt,s={ArrowLeft:[-n,0],ArrowRight:[n,0],ArrowUp:[0,n],ArrowDown:[0,-n]}[t.key],l=o??e[e.length-1]??[0,0];if(s)r([l[0]+s[0],l[1]+s[1]]);else if("Enter"===t.key)$(l);else{if("Backspace"!==t.key&&"Delete"!==t.key)return;a(e.slice(0,-1))}t.preventDefault()}} />
<div class="tools"><button type="button" onClick=${()=>a(e.slice(0,-1))} disabled=${0===e.length}>Undo point</button>
<button type="button" onClick=${()=>a([])} disabled=${0===e.length}>Clear</button>
<button type="button" onClick=${()=>l(s/2)} disabled=${s<=4} aria-label="Closer">+</button>
<button type="button" onClick=${()=>l(2*s)} disabled=${s>=256} aria-label="Wider">−</button>
<span class="note">Press to add, drag to move; snaps to ${tt} m. Corners are turned in place.</span></div>
</div>`}var st=()=>[{kind:"straight",length:6},{kind:"turn",angle:90},{kind:"straight",length:4}];function lt({legs:e,change:a,fault:n}){let s=(t,n)=>{let s=[...e];[s[t],s[t+n]]=[s[t+n],s[t]],a(s)};return t`<fieldset class="legs"><legend>Legs</legend><ol>
${e.map((l,o)=>t`<li key=${o} class=${n===o?"faulty":""}>
<select aria-label=${`Kind of leg ${o+1}`} value=${l.kind} onChange=${t=>a(e.map((e,a)=>a===o?Ze(t.currentTarget.value):e))}>
${Object.entries(Ye).map(([e,{name:a}])=>t`<option key=${e} value=${e}>${a}</option>`)}</select>
<span class="leg-fields">${Object.entries(Ye[l.kind].fields).map(([n,s])=>t`<label key=${n} class="inline"><span class="hidden">${`Leg ${o+1}, ${s.label}`}</span>
<input type="number" step="any" min=${s.min} required title=${s.label} value=${l[n]} onInput=${t=>((t,n)=>a(e.map((e,a)=>a===t?{...e,...n}:e)))(o,{[n]:t.currentTarget.valueAsNumber})} /><span class="unit">${s.unit}</span></label>`)}</span>
<span class="leg-tools"><button type="button" class="plain" disabled=${0===o} aria-label=${`Move leg ${o+1} up`} onClick=${()=>s(o,-1)}>↑</button>
<button type="button" class="plain" disabled=${o===e.length-1} aria-label=${`Move leg ${o+1} down`} onClick=${()=>s(o,1)}>↓</button>
<button type="button" class="plain" disabled=${1===e.length} aria-label=${`Remove leg ${o+1}`} onClick=${()=>a(e.filter((e,t)=>t!==o))}>×</button></span></li>`)}
</ol><button type="button" onClick=${()=>a([...e,Ze("straight")])}>Add a leg</button></fieldset>`}function ot(e,t,a){if(!t)return e.map(()=>null);let n=t.time_s,s=t[a],l=1;return e.map(e=>{for(;l<n.length-1&&n[l]<e;)l+=1;let t=n[l]>n[l-1]?Math.max(0,Math.min(1,(e-n[l-1])/(n[l]-n[l-1]))):1;return s[l-1]+t*(s[l]-s[l-1])})}function rt({answer:e}){let a=e.profile,n=a.yaw_rate_rad_s.some(e=>Math.abs(e)>1e-6),{trapezoid:s,triangle:l}=e.baselines,o=W(()=>[a.time_s,a.speed_m_s,ot(a.time_s,s?.profile,"speed_m_s"),ot(a.time_s,l?.profile,"speed_m_s"),n?a.yaw_rate_rad_s:a.time_s.map(()=>null)],[e]),r=W(()=>[a.time_s,a.power_w],[e]),i={sync:{key:"plan"},drag:{x:!1,y:!1}};return t`
<${D} make=${()=>{let e=h(),t={show:!1};return{cursor:i,scales:{x:{time:!1},yaw:{}},axes:[S("",{size:28}),S("speed, m/s"),...n?[S("yaw rate, rad/s",{scale:"yaw",side:1,grid:{show:!1}})]:[]],series:[{},{stroke:e.accent,width:2.25,points:t},{stroke:e.muted,width:1.25,dash:[6,4],points:t},{stroke:e.muted,width:1.25,dash:[2,3],points:t},{stroke:e.modelled,width:1.25,scale:n?"yaw":"y",points:t}]}}} data=${o} height=${210} changes=${[n]} label=${`Speed over ${Q(e.duration_s)}, greatest ${I(e.peak_speed_m_s,2)} metres a second`} />
<${D} make=${()=>{let e=h();return{cursor:i,scales:{x:{time:!1}},axes:[S("time, s",{size:28}),S("power, W"),...n?[S(" ",{scale:"y",side:1,grid:{show:!1},ticks:{show:!1},values:()=>[]})]:[]],series:[{},{stroke:e.accent,width:1.75,fill:R(e.accent,.12),points:{show:!1}}]}}} data=${r} height=${150} changes=${[n]} label="Battery power of the optimal profile over time" />
<p class="note foot"><span class="swatch accent"></span>least energy ${n&&t`<span class="swatch modelled"></span>yaw rate `}<span class="swatch dashed"></span>trapezoid <span class="swatch dotted"></span>triangle</p>`}function it({answer:e,take:a}){let n=e.pareto,{trapezoid:s,triangle:l}=e.baselines,o=W(()=>{let t=[n,[e],[s],[l]].map(e=>new Map(e.filter(Boolean).map(e=>[e.duration_s,e.energy_j]))),a=[...new Set(t.flatMap(e=>[...e.keys()]))].sort((e,t)=>e-t);return[a,...t.map(e=>a.map(t=>e.get(t)??null))]},[e]),[r,i]=O(0),d=n[Math.min(r,n.length-1)];return t`<${D} make=${()=>{let e=h(),t=(e,t,a)=>({stroke:"transparent",paths:()=>null,points:{show:!0,size:t,width:2,stroke:e,fill:a}});return{scales:{x:{time:!1}},cursor:{y:!1,drag:{x:!1,y:!1},points:{show:!1}},axes:[S("duration, s",{size:28,space:70}),S("energy, J",{size:58})],series:[{},{stroke:e.modelled,width:1.5,spanGaps:!0,points:{show:!0,size:5,fill:e.modelled}},t(e.accent,12,e.accent),t(e.muted,9,e.screen),t(e.muted,9,e.muted)]}}} data=${o} height=${230} changes=${[]} label=${`Energy against duration, from ${Q(n[0].duration_s)} to ${Q(n[n.length-1].duration_s)}`} />
<p class="note foot"><span class="swatch accent dot"></span>this plan <span class="swatch hollow dot grey"></span>trapezoid <span class="swatch grey dot"></span>triangle <span class="swatch modelled"></span>front</p>
<div class="front-pick"><label><span>Walk the front</span><input type="range" min="0" max=${n.length-1} value=${r} onInput=${e=>i(e.currentTarget.valueAsNumber)} aria-valuetext=${`${Q(d.duration_s)}, ${Z(H(d.energy_j))}`} /></label>
<span class="number">${I(d.duration_s,2)} s · ${Z(H(d.energy_j,4))}; a second less costs ${dt(d.time_multiplier_w)}</span>
<button type="button" onClick=${()=>a(d)}>Take as deadline</button></div>`}var dt=e=>0!==e&&Math.abs(e)<.005?"less than 0.01 J":Z(H(e)),ut={closed_form:"formulas",interior_point:"an interior-point method",mixed:"formulas and an interior-point method"};function ct(e){if(!e)return"not possible here";let t=e.saving_fraction,a=Z(X(Math.abs(t),1));return e.within_limits?t>=0?`we save ${a}`:`costs ${a} less`:`breaks the limits, and costs ${a} ${t>=0?"more":"less"}`}function ht({answer:e}){let a=e.certificate,n=(e,a)=>t`<tr><th scope="row">${e}</th><td>${a}</td></tr>`;return t`<table class="facts"><tbody>
${n("Found by",ut[a.method]??ne(a.method))}
${n("At most above the optimum",dt(a.gap_j))}
${n("Error of the time steps",dt(a.discretisation_j))}
${n("A global optimum",a.convex?"yes: the problem is convex":"not proven: the problem is not convex")}
${n("A second less costs",dt(a.time_multiplier_w))}
${n("Limits met",0===a.binding.length?"none":a.binding.map(ne).join(", "))}
${n("Braking",`${Z(H(e.braking_j))}, of which ${Z(H(e.recovered_j))} returns`)}
${n("Peak power",Z(q(e.peak_power_w)))}
${n("Model",`version ${e.model_version}`)}
</tbody></table>`}function $t({answer:e,autonomy:a}){if(null!==a.error)return t`<${y} error=${a.error} />`;if(null===a.value)return t`<p class="verdict open">The robot has not told its charge: enter it to see whether the robot makes it.</p>`;let n=a.value,s=n.usable_energy_j-e.energy_j,l=s>=0,o=n.state_of_charge-n.reserve_fraction,r=o>0?n.state_of_charge-o*e.energy_j/n.usable_energy_j:null,i=e.energy_j>0?Math.floor(n.usable_energy_j/e.energy_j):null;return t`<div class=${"verdict-box "+(l?"makes":"fails")}>
<p class="verdict"><b>${l?"The robot makes it":"The robot does not make it"}</b>${l?t`: arrives with ${Z(X(r,r>.995?2:1))} charge, ${Z(H(s))} above its reserve of ${Z(X(n.reserve_fraction))}.`:t`: ${Z(H(-s))} short of its reserve of ${Z(X(n.reserve_fraction))}.`}</p>
<p class="note">Starts with ${Z(X(n.state_of_charge,1))}, ${Z(H(n.usable_energy_j))} usable${i>=2?`: about ${I(Number(i.toPrecision(2)))} such drives`:""}. At its ${"model"===n.consumption.basis?"modelled":"recent"} consumption it has ${Z(V(n.range_m))} or ${Q(n.run_time_s)} left.</p></div>`}var mt={fleet:function(){C("Fleet");let e=i(),a=c(),[n,s]=O(""),[l,o]=O("all"),[r,d]=O({key:"robot",down:!1}),[u,h]=O(!1),$=[...e.robots.values()].filter(e=>de(e.state)).length,m="all"===l&&""===n&&$>0&&$<e.robots.size,p=function(e,t,a,n){let s=z({key:"",at:-1/0,rows:[]}),l=`${t}|${a}|${n.key}|${n.down}|${e.robots.size}|${e.loads}`,o=performance.now();if(s.current.key!==l||o-s.current.at>3e3){let r=ie.find(e=>e.key===n.key),i=function(e,t,a){let n=t.trim().toLowerCase(),s={all:()=>!0,heard:e=>!de(e),live:e=>e.live,charging:e=>null!==e.charging,silent:e=>!e.live,mission:e=>null!==e.mission,low:e=>null!==e.state_of_charge&&e.state_of_charge<.25}[a];return[...e.values()].filter(e=>s(e.state)&&(""===n||e.id.toLowerCase().includes(n)||(e.state.mission?.mission_id??"").toLowerCase().includes(n)))}(e.robots,t,a).sort((e,t)=>de(e.state)-de(t.state)||(n.down?-1:1)*r.sort(e,t)||re.compare(e.id,t.id));s.current={key:l,at:o,rows:i}}return s.current.rows}(e,n,m&&!u?"heard":l,r),[g,f,_]=function(e){let t=z(null),[a,n]=O([0,40]);return A(()=>{let a=()=>{if(null===t.current)return;let a=t.current.getBoundingClientRect().top,s=Math.max(0,Math.floor(-a/46)-8),l=Math.min(e,Math.ceil((innerHeight-a)/46)+8);n(e=>e[0]===s&&e[1]===l?e:[s,l])};return a(),addEventListener("scroll",a,{passive:!0}),addEventListener("resize",a),()=>{removeEventListener("scroll",a),removeEventListener("resize",a)}},[e]),[t,Math.min(a[0],e),Math.min(Math.max(a[1],0),e)]}(p.length);return e.loaded||0!==e.robots.size?0===e.robots.size?t`<h1>Fleet</h1><${b} title="No robot yet">A robot appears here when its telemetry arrives over LCM or its file is put to <code>/v1/robots/…</code>.<//>`:t`
<h1 class="hidden">Fleet</h1>
<${me} robots=${e.robots} />
<div class="tools">
<label class="find"><span class="hidden">Find a robot or mission</span><input type="search" placeholder="Find a robot or mission" value=${n} onInput=${e=>s(e.currentTarget.value)} /></label>
<${x} label="Show" value=${l} onChange=${o} options=${[["all","All"],["live","Live"],["silent","Silent"],["mission","On a mission"],["charging","Charging"],["low","Low charge"]]} />
<span class="key"><span class="swatch measured"></span>measured <span class="swatch modelled"></span>modelled</span>
</div>
<table class="grid fleet" aria-rowcount=${p.length+1}>
<thead><tr>${ie.map(e=>t`<th key=${e.key} scope="col" class=${e.class} aria-sort=${(e=>e.key!==r.key?void 0:r.down?"descending":"ascending")(e)}>
${e.sort?t`<button type="button" onClick=${()=>(e=>d(t=>({key:e,down:t.key===e&&!t.down})))(e.key)}>${e.title}<span class="arrow" aria-hidden="true">${e.key===r.key?r.down?"▾":"▴":""}</span></button>`:e.title}</th>`)}</tr></thead>
<tbody ref=${g}>
${f>0&&t`<tr key="above" aria-hidden="true" class="spacer"><td colspan=${ie.length} style=${{height:46*f+"px"}}></td></tr>`}
${p.slice(f,_).map((e,n)=>t`<${$e} key=${e.id} entry=${e} revision=${e.revision} index=${f+n} dark=${a} />`)}
${_<p.length&&t`<tr key="below" aria-hidden="true" class="spacer"><td colspan=${ie.length} style=${{height:46*(p.length-_)+"px"}}></td></tr>`}
</tbody>
</table>
${0===p.length&&t`<${b} title="No robot matches" />`}
${m&&t`<p class="fold"><button type="button" class="plain" aria-expanded=${String(u)} onClick=${()=>h(!u)}>${u?"Hide":"Show"} ${$} ${1===$?"robot":"robots"} not heard since the service started</button></p>`}`:null!==e.error?t`<${y} error=${e.error} />`:t`<${v} what="the fleet" />`},robots:function({id:e}){C(e);let a=i(),n=c(),r=o(`/v1/robots/${l(e)}`),d=o(`/v1/missions${s({robot_id:e,limit:12})}`),u=a.robots.get(e),h=u?.state,$=h?.mission?.id;return A(()=>{null!==d.value&&d.reload()},[$]),!h&&a.loaded&&404===r.error?.status?t`<${b} title=${`There is no robot ${e}`}>See the <a href="#/fleet">fleet</a>.<//>`:t`
<div class="heading"><p class="crumbs"><a href="#/fleet">Fleet</a></p><h1>${e}</h1>
${h&&t`<span class="health"><${ue} state=${h} /></span>`}
<span class="spring"></span><a class="button" href=${`#/plan${s({robot:e})}`}>Plan a drive</a></div>
${h&&null===h.silent_s&&t`<p class="note">Nothing was heard of it since the service started. What is kept of it stands below.</p>`}
${h&&null!==h.silent_s&&t`<dl class="readouts">
<${_} large label=${null===h.measured_power_w?"Power (modelled)":"Power"} of=${q(h.measured_power_w??h.modelled_power_w)} channel=${null===h.measured_power_w?"modelled":"measured"} note=${t`<${se} track=${u.power} revision=${u.revision} dark=${n} width=${120} height=${26} />`} />
<${_} large label="Charge" of=${X(h.state_of_charge)} note=${[null===h.state_of_charge?"":ce(h).text,null===h.battery_voltage_v?"":Z(Y(h.battery_voltage_v,"V",2))].filter(Boolean).join(" · ")} />
<${_} large label="Range" of=${V(h.range_m)} note=${le(h.range_quantiles_m,K)} />
<${_} large label="Run time" of=${ee(h.run_time_s)} note=${le(h.run_time_quantiles_s,(e,t)=>`${ee(e)} – ${ee(t)}`)} />
${null===h.charging&&J(h.charge.time_to_charged_s)&&t`<${_} large label="To charge" of=${ee(h.charge.time_to_charged_s)} note="if it went now" />`}
<${_} large label="Speed" of=${Y(h.speed_m_s,"m/s",2)} />
<${_} large label="Payload" of=${Y(h.payload_kg,"kg")} />
<${_} large label="Windings, right · left" of=${null===h.winding_temperature_c[0]?"–":`${I(h.winding_temperature_c[0])} · ${I(h.winding_temperature_c[1])} °C`} />
<${_} large label="Mission" of=${H(h.mission?.energy.battery_j)} note=${h.mission?t`<a href=${p(h.mission.id)}>${h.mission.mission_id}</a>`:"none running"} />
</dl>`}
${(h||r.value)&&t`<${fe} part="RobotHistory" id=${e} />`}
<${k} title="Recent missions" aside=${t`<a href=${`#/missions${s({robot:e})}`}>All missions of ${e}</a>`}><${w} of=${d} what="missions">${e=>0===e.missions.length?t`<${b} title="No mission yet" />`:t`<div class="scroll"><${Oe} missions=${e.missions} with_robot=${!1} /></div>`}<//><//>
<div class="columns">
<${k} class="screen" title="On the floor now">${u?t`<${Fe} entry=${u} />`:t`<${b} title="Never heard" />`}<//>
<${k} title="Model">${r.value?t`<${ze} model=${r.value.model} />`:t`<p class="note">none</p>`}<//>
</div>`},missions:function({given:e}){C("Missions");let[a,n]=O(e),[l,r]=O([""]),i=z(JSON.stringify(e));A(()=>{JSON.stringify(e)!==i.current&&(i.current=JSON.stringify(e),n(e),r([""]))},[e]);let d=W(()=>Pe(a),[a]),u=l[l.length-1],c=o(`/v1/missions${s({...d,limit:50,cursor:u})}`),h=o(`/v1/mission-totals${s(d)}`);return t`
<h1 class="hidden">Missions</h1>
<${De} given=${a} change=${e=>{let t=Object.fromEntries(Object.entries(e).filter(([,e])=>""!==e));i.current=JSON.stringify(t),n(t),r([""]),g("missions",t)}} />
<${Le} told=${h} />
<div class="tools"><button type="button" onClick=${()=>{c.reload(),h.reload()}}>Refresh</button>
<span class="note">Times are local (${Intl.DateTimeFormat().resolvedOptions().timeZone})</span>
<${Re} given=${a} total=${h.value?.missions??0} /></div>
<${w} of=${c} what="missions">${({missions:e,next_cursor:n})=>t`
${c.error&&t`<${y} error=${c.error} retry=${c.reload} />`}
<div class=${c.loading?"stale":""} aria-busy=${String(c.loading)}>
${0===e.length?t`<${b} title=${Object.keys(a).length>0?"No mission matches":"No mission yet"}>Missions appear when a robot announces one or sends telemetry.<//>`:t`<div class="scroll"><${Oe} missions=${e} /></div>`}
</div>
${e.length>0&&t`<nav class="pages" aria-label="Pages of missions">
<button type="button" disabled=${1===l.length} onClick=${()=>r(l.slice(0,-1))}>Newer</button>
<span>${I(50*(l.length-1)+1)} – ${I(50*(l.length-1)+e.length)}${h.value?` of ${I(h.value.missions)}`:""}</span>
<button type="button" disabled=${null===n} onClick=${()=>r([...l,n])}>Older</button>
</nav>`}`}<//>`},mission:function({id:e}){let a=o(`/v1/missions/${l(e)}`),n=null!==a.value,r=o(n?`/v1/missions/${l(e)}/ledger`:null),i=o(n?`/v1/missions/${l(e)}/trace${s({points:700})}`:null),d=null!==i.value&&i.value.start_utime_us.length>=350,u=o(d?`/v1/missions/${l(e)}/trace${s({points:6e3})}`:null),c=d?u.value:i.value;C(a.value?.mission_id??"Mission");let h="open"===a.value?.state;return A(()=>{if(!h)return;let e=setInterval(()=>[a,r,i].forEach(e=>e.reload()),3e3);return()=>clearInterval(e)},[h]),!n&&[400,404].includes(a.error?.status)?t`<${b} title=${`There is no mission ${e}`}>No mission of this history has that number. See <a href="#/missions">all missions</a>.<//>`:t`<${w} of=${a} what="the mission">${e=>{let a=e.energy,n=Ee(a);return t`
<div class="heading"><p class="crumbs"><a href="#/missions">Missions</a> / <a href=${m(e.robot_id)}>${e.robot_id}</a></p>
<h1>${e.mission_id}</h1><${j} mission=${e} />
${e.incomplete&&t`<span class="flag">incomplete${e.incomplete_reason?`: ${ne(e.incomplete_reason)}`:""}</span>`}
<span class="note">${te(e.start_utime_us)}</span></div>
<dl class="readouts">
<${_} large label=${null===a.measured_j?"From the battery (modelled)":"From the battery"} of=${H(a.battery_j)} channel=${null===a.measured_j?"modelled":"measured"} />
<${_} large label="Modelled" of=${H(a.modelled_j)} channel="modelled" />
<${_} large label="Unexplained" of=${(()=>{let e=H(a.unexplained_j);return{n:G(e.n),u:e.u}})()} channel="gap" note=${null===n?"":`ratio ${I(n,3)}`} />
<${_} large label="Distance" of=${V(a.distance_m)} />
<${_} large label="Duration" of=${Q(a.duration_s)} />
<${_} large label="Per metre" of=${Y(a.distance_m>.1?a.battery_j/a.distance_m:null,"J/m")} />
<${_} large label="Payload" of=${Y(e.payload_kg,"kg")} />
</dl>
<${w} of=${i} what="the trace">${a=>t`<${qe} mission=${e} whole=${a} fine=${c??a} />`}<//>
<div class="columns">
<${k} title="Where the energy went"><${w} of=${r} what="the ledger">${({ledger:e})=>t`<${Je} terms_j=${e.terms_j} battery_j=${e.battery_j} closure=${e.closure_relative} />`}<//><//>
<div>
<${k} title="Against the minimum-energy drive">${null===e.model_version?t`<${b} title="No model">The robot had no model on this mission.<//>`:h?t`<${b} title="Still driving">Compared when the mission ends.<//>`:e.gap_s>0?t`<${b} title="Not compared">For ${Q(e.gap_s)} of the mission nothing is known.<//>`:c&&t`<${Ve} mission=${e} trace=${c} />`}<//>
<${k} title="Record"><${Ke} mission=${e} /><//>
</div>
</div>`}}<//>`},plan:function({given:e}){C("Plan");let a=i(),s=[...a.robots.values()].filter(e=>e.state.has_model).map(e=>e.id).sort(),[o,r]=O(e.robot??""),[d,u]=O("legs"),[c,h]=O(st),[$,m]=O([[-5,-2],[2,-2],[2,2.5],[5,2.5]]),[p,f]=O({payload:"",deadline:"",value:"",charge:""}),[w,M]=O({answer:null,error:null,busy:!1,autonomy:{value:null,error:null}}),j=z(null),T=s.includes(o)?o:s[0]??"",N=W(()=>"legs"===d?function(e){let[t,a,n]=[0,0,0],s=[[t,a]];for(let l of e)if("straight"===l.kind)t+=l.length*Math.cos(n),a+=l.length*Math.sin(n),s.push([t,a]);else if("turn"===l.kind)n+=l.angle*Xe;else if("arc"===l.kind){let e=l.angle<0?-1:1,o=Math.max(2,Math.ceil(Math.abs(l.angle)/5)),r=t-e*l.radius*Math.sin(n),i=a+e*l.radius*Math.cos(n);for(let t=1;t<=o;++t){let a=n+l.angle*Xe*t/o;s.push([r+e*l.radius*Math.sin(a),i-e*l.radius*Math.cos(a)])}n+=l.angle*Xe,[t,a]=s[s.length-1]}return s}(c).filter(([e,t])=>Number.isFinite(e+t)):$,[d,c,$]),S=W(()=>w.answer?.profile.x_m.map((e,t)=>[e,w.answer.profile.y_m[t],w.answer.profile.power_w[t]]),[w.answer]),P=async(e={})=>{let t={...p,...e},s=e=>""===e?void 0:Number(e);if("draw"===d&&$.length<2)return void M(e=>({...e,error:Object.assign(new Error("Draw at least two points."),{title:"No path yet"})}));j.current?.abort();let o=j.current=new AbortController;M(e=>({...e,busy:!0,error:null}));let r={..."draw"===d?et($):{path:c.map(Qe)},payload_kg:s(t.payload),deadline_s:s(t.deadline),value_of_time_w:s(t.value),pareto_points:24,baseline_columns:!0},i=s(t.charge),u=`/v1/robots/${l(T)}`,h=void 0!==i||null!==a.robots.get(T)?.state.state_of_charge?n(`${u}/autonomy`,{state_of_charge:void 0===i?void 0:i/100,payload_kg:r.payload_kg},o.signal).then(e=>({value:e,error:null}),e=>({value:null,error:e})):{value:null,error:null};try{let e=await n(`${u}/profile`,r,o.signal);M({answer:e,of:N,error:null,busy:!1,autonomy:await h})}catch(e){"AbortError"!==e.name&&M(t=>({...t,error:e,busy:!1}))}};if(A(()=>(""!==T&&P(),()=>j.current?.abort()),[T]),a.loaded&&0===s.length)return t`<h1>Plan</h1><${b} title="No robot has a model">Put a robot file to <code>/v1/robots/…</code> to plan with it.<//>`;if(!a.loaded)return t`<${v} what="the fleet" />`;let E=(e,a,n,s)=>t`<label class="field"><span>${a}</span><span class="with-unit"><input type="number" step="any" min="0" value=${p[e]} onInput=${t=>f({...p,[e]:t.currentTarget.value})} ...${s} /><span class="unit">${n}</span></span></label>`,D=w.answer,L=/^\/path\/(\d+)/.exec(w.error?.field??""),R=D?.baselines;return t`<h1 class="hidden">Plan</h1><div class="plan">
<form class="plan-form" onSubmit=${e=>{e.preventDefault(),P()}}>
<label class="field"><span>Robot</span><select value=${T} onChange=${e=>{r(e.currentTarget.value),g("plan",{robot:e.currentTarget.value})}}>${s.map(e=>t`<option key=${e} value=${e}>${e}</option>`)}</select></label>
<${x} label="How to give the path" value=${d} onChange=${u} options=${[["legs","Enter legs"],["draw","Draw"]]} />
${"legs"===d?t`<${lt} legs=${c} change=${h} fault=${L?Number(L[1]):null} />`:t`<p class="note">${$.length} points, ${Z(V($.slice(1).reduce((e,[t,a],n)=>e+Math.hypot(t-$[n][0],a-$[n][1]),0)))}. Draw on the floor.</p>`}
<div class="terms">
${E("payload","Payload","kg",{placeholder:"0"})}
${E("deadline","Deadline","s",{placeholder:"free"})}
${E("value","Value of time","W",{placeholder:"0"})}
${E("charge","Charge now","%",{placeholder:"live",max:100})}
</div>
<button type="submit" class="primary" disabled=${""===T}>${w.busy?"Computing …":"Compute"}</button>
</form>
<div class="plan-result" aria-live="polite" aria-busy=${String(w.busy)}>
${w.error&&t`<${y} error=${w.error} />`}
${"draw"===d&&t`<${k} class="screen" title="Draw the path"><${nt} points=${$} change=${m} /><//>`}
${null===D?null===w.error&&t`<${v} what="the plan" />`:t`<div class=${w.busy?"stale":""}>
<${$t} answer=${D} autonomy=${w.autonomy} />
<dl class="readouts">
<${_} large label="Least energy" of=${H(D.energy_j)} channel="accent" />
<${_} large label="Duration" of=${Q(D.duration_s)} />
<${_} large label="Distance" of=${V(D.distance_m)} />
<${_} large label="Top speed" of=${Y(D.peak_speed_m_s,"m/s",2)} />
<${_} large label="Per metre" of=${Y(D.distance_m>0?D.energy_j/D.distance_m:null,"J/m")} />
</dl>
<div class="columns">
<div>
<${k} class="screen" title="Speed and power"><${rt} answer=${D} /><//>
<${k} title="Against the usual profiles">
<${We} label="Energy of the plan, a trapezoid and a triangle in the same time" rows=${[{name:"Least energy",value:D.energy_j,of:H(D.energy_j,4),channel:"least",note:""},...["trapezoid","triangle"].map(e=>({name:e[0].toUpperCase()+e.slice(1),value:R[e]?.energy_j??null,of:H(R[e]?.energy_j,4),channel:"plain",note:ct(R[e])}))]} />
<p class="note foot">All three in the same time on every run between stops.</p>
<//>
<${k} title="Where the energy goes"><${Je} terms_j=${D.ledger_j} battery_j=${D.energy_j} measured=${!1} /><//>
</div>
<div>
<${k} class="screen" title="On the floor"><${je} points=${S} under=${w.of===N?null:N} height=${340} label="The planned path, coloured by power; circle: start, square: end" /><//>
<${k} class="screen" title="Energy against time">${D.pareto.length<2?t`<${b} title="No front">Nothing to trade: time and energy do not compete on this path.<//>`:t`<${it} answer=${D} take=${({duration_s:e})=>{let t=String(Math.ceil(100*e)/100);f({...p,deadline:t}),P({deadline:t})}} />`}<//>
<${k} title="How sure the optimum is"><${ht} answer=${D} /><//>
</div>
</div></div>`}
${"legs"===d&&null===D&&N.length>1&&t`<${k} class="screen" title="Path"><${je} points=${N.map(([e,t])=>[e,t,NaN])} legend=${!1} label="The path that was entered" /><//>`}
</div></div>`},gap:e=>t`<${fe} part="Gap" ...${e} />`};function pt(){let e=i(),a={live:"Live",connecting:"Connecting",offline:"Offline"}[e.link];return t`<span class=${`link ${e.link}`} role="status"><span class="lamp" aria-hidden="true"></span>${a}</span>`}function gt(){let e=i(),[a,n]=O(!1);if(A(()=>{if(n(!1),"offline"!==e.link)return;let t=setTimeout(()=>n(!0),1500);return()=>clearTimeout(t)},[e.link]),!a)return null;let s=ae(1e3*e.since_ms);return t`<div class="banner" role="alert">No connection to the service since ${s}. What is shown is as of then; trying again.</div>`}r(),P(t`<${function(){let[a,n]=O($(location.hash)),s=z(null),l=z(!0),o=c();A(()=>{let e=()=>n($(location.hash));return addEventListener("hashchange",e),()=>removeEventListener("hashchange",e)},[]),A(()=>{l.current?l.current=!1:(scrollTo(0,0),s.current.focus({preventScroll:!0}))},[a.view,a.id]);let r=mt[a.view],i={robots:"fleet",mission:"missions"}[a.view]??a.view,d=(e,a)=>t`<a href=${`#/${e}`} aria-current=${i===e?"page":void 0}>${a}</a>`;return t`
<a class="skip" href="#main" onClick=${e=>{e.preventDefault(),s.current.focus()}}>Skip to content</a>
<header class="top">
<a class="mark" href="#/fleet" aria-label="joulecast, fleet">
<svg viewBox="0 0 32 20" width="38" height="24" aria-hidden="true"><path d="M1 14h6l4-12 6 17 4-10 2 5h8" /></svg>joulecast</a>
<nav aria-label="Views">${d("fleet","Fleet")}${d("missions","Missions")}${d("plan","Plan")}${d("gap","Gap")}</nav>
<${pt} />
<button type="button" class="theme" onClick=${u} aria-label=${o?"Light theme":"Dark theme"} title=${o?"Light theme":"Dark theme"}>
<svg viewBox="0 0 20 20" width="18" height="18" aria-hidden="true"><circle cx="10" cy="10" r="7.5" class="ring" /><path d="M10 2.5a7.5 7.5 0 0 1 0 15z" /></svg></button>
</header>
<${gt} />
<main id="main" tabindex="-1" ref=${s}>
<${e} view=${location.hash}>
${r?t`<${r} key=${`${a.view}/${a.id??""}`} id=${a.id} given=${a.given} />`:t`<${b} title="There is no such page">Go to the <a href="#/fleet">fleet</a>.<//>`}
<//>
</main>`}} />`,document.getElementById("app"));
