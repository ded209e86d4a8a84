/* joulecast operator page, built from source/; licences: third_party.txt */
import{$ as e,B as t,C as a,D as n,E as s,F as l,G as r,H as o,I as i,J as d,K as u,L as c,M as h,N as $,O as m,P as p,Q as g,R as f,S as _,T as b,U as v,V as y,W as w,X as k,Y as x,Z as M,_ as j,a as T,b as C,ba as N,c as S,ca as P,d as E,da as O,e as D,ea as A,f as L,g as R,h as z,i as F,j as W,k as B,l as I,m as J,n as U,o as G,p as H,q,r as V,s as K,t as X,u as Y,v as Z,w as Q,x as ee,y as te,z as ae}from"./base.js";var ne=class extends C{canvas=T();shouldComponentUpdate(e){return e.revision!==this.props.revision||e.dark!==this.props.dark||e.track!==this.props.track}componentDidMount(){this.draw()}componentDidUpdate(){this.draw()}draw(){let e=this.canvas.current,{width:t=128,height:a=30,track:n}=this.props,s=devicePixelRatio||1,l=e.getContext("2d"),r=d();e.width!==t*s&&(e.width=t*s,e.height=a*s),l.setTransform(s,0,0,s,0,0),l.clearRect(0,0,t,a),l.strokeStyle=r.graticule,l.lineWidth=1,l.beginPath();for(let e=t-.5;e>0;e-=32)l.moveTo(e,0),l.lineTo(e,a);let o=n.last(),i=1,u=0;for(let[,e,t]of o)e>i&&(i=e),t>i&&(i=t),e<u&&(u=e);let c=e=>a-2-(e-u)/(i-u)*(a-5);if(l.moveTo(0,Math.round(c(0))+.5),l.lineTo(t,Math.round(c(0))+.5),l.stroke(),o.length<2)return;let h=o[o.length-1][0];for(let[e,a,n]of[[2,r.modelled,1],[1,r.measured,1.5]]){l.strokeStyle=a,l.lineWidth=n,l.lineJoin="round",l.beginPath();let s=-1/0;for(let a of o){let n=t-2-(h-a[0])/9e7*t;Number.isFinite(a[e])&&(a[0]-s>5e6?l.moveTo(n,c(a[e])):l.lineTo(n,c(a[e])),s=a[0])}l.stroke()}}render(){let{width:e=128,height:t=30}=this.props;return ee`<canvas class="sparkline" ref=${this.canvas} style=${{width:`${e}px`,height:`${t}px`}} aria-hidden="true"></canvas>`}};function se(e){let[t,a]=E(new Map);return D(()=>{let t=()=>ae("/v1/autonomy",e?{robots:[e]}:{}).then(e=>a(new Map(e.robots.map(e=>[e.robot_id,{range:e.range_quantiles_m,time:e.run_time_quantiles_s}]))),()=>{});t();let n=setInterval(t,3e4);return()=>clearInterval(n)},[e]),t}function le(e,t){if(!F(e?.p05)||!F(e.p95))return"";let a=t(e.p05),n=t(e.p95);return ee`<span title="nine times of ten"><span class="hidden">90 % between </span>${a.u===n.u||"0"===a.n?a.n:V(a)}–${V(n)}</span>`}function re({live:e,band:t}){return ee`<${m} of=${G(t?.p50??e)} /><span class="below">${le(t,G)}</span>`}var oe=e=>(t,a)=>{let n=e(t.state),s=e(a.state);return(null==n)-(null==s)||(n<s?-1:n>s?1:0)},ie=new Intl.Collator("en",{numeric:!0}),de=[{key:"robot",title:"Robot",sort:(e,t)=>ie.compare(e.id,t.id),class:"robot"},{key:"health",title:"Telemetry",sort:oe(e=>e.live?0:null===e.silent_s?1/0:1+e.silent_s),class:"health"},{key:"power",title:"Power",sort:oe(e=>e.measured_power_w??e.modelled_power_w),class:"figure power"},{key:"trace",title:"Last 90 s",class:"spark"},{key:"charge",title:"Charge",sort:oe(e=>e.state_of_charge),class:"charge"},{key:"range",title:"Range",sort:oe(e=>e.range_m),class:"figure range"},{key:"time",title:"Run time",sort:oe(e=>e.run_time_s),class:"figure wide"},{key:"speed",title:"Speed",sort:oe(e=>e.speed_m_s),class:"figure wide"},{key:"mission",title:"Mission",sort:oe(e=>e.mission?.start_utime_us),class:"mission"},{key:"spent",title:"Spent",sort:oe(e=>e.mission?.energy.battery_j),class:"figure spent"}],ue=e=>null===e.silent_s;function ce({state:e}){let{level:t,text:a,faults:n}=function(e){let t=Object.values(e.faults).reduce((e,t)=>e+t,0);return e.has_model?e.live?{level:"good",text:"live",faults:t}:ue(e)?{level:"none",text:"not heard",faults:t}:{level:"bad",text:`silent ${K(e.silent_s)}`,faults:t}:{level:"bad",text:"no model",faults:t}}(e),s=Object.entries(e.faults).map(([e,t])=>`${t} ${Q(e)}`).join(", ");return ee`<span class=${`lamp ${t}`} aria-hidden="true"></span>${a}
${n>0&&ee`<span class="note" title=${s}> · ${W(n)} faulty</span>`}`}function he({charging:e,charge:t,state_of_charge_sd:a}){let n=t?.time_to_charged_s;return"full"===e?.phase?{text:"charged",what:"At its charger, which has ended"}:e?{text:"charging"+(F(n)?`, ${X(n)}`:""),what:"At its charger"+(F(n)?`, ready in ${X(n)}`:"")}:{text:F(a)?`± ${V(H(a))}`:"",what:"standard deviation"}}function $e({state:e}){let t=e.state_of_charge;if(null===t)return ee`<span class="note">unknown</span>`;let{text:a,what:n}=he(e);return ee`<span class=${"charge-bar "+(e.charging?"charging":t<.25?"low":"")} aria-hidden="true"><span style=${{width:`${Math.max(2,100*t)}%`}}></span></span>
<${m} of=${H(t)} /><span class="below" title=${n}>${a}</span>`}var me=class extends C{shouldComponentUpdate(e){return e.revision!==this.props.revision||e.entry!==this.props.entry||e.index!==this.props.index||e.dark!==this.props.dark||e.band!==this.props.band}render({entry:e,index:t,revision:a,dark:n,band:s}){let l=e.state,r=null===l.measured_power_w;return ee`<tr aria-rowindex=${t+2} class=${l.live?"":"quiet"}>
<th scope="row" class="robot"><a href=${c(e.id)}>${e.id}</a></th>
<td class="health"><${ce} state=${l} /></td>
<td class="figure power"><${m} of=${U(l.measured_power_w??l.modelled_power_w)} />${r&&null!==l.modelled_power_w&&ee`<span class="note"> mod.</span>`}</td>
<td class="spark"><${ne} track=${e.power} revision=${a} dark=${n} /></td>
<td class="charge"><${$e} state=${l} /></td>
<td class="figure range"><${re} live=${l.range_m} band=${s} /></td>
<td class="figure wide">${X(l.run_time_s)}</td>
<td class="figure wide"><${m} of=${q(l.speed_m_s,"m/s",2)} /></td>
<td class="mission">${l.mission?ee`<a href=${h(l.mission.id)} title=${l.mission.mission_id}>${((e,t)=>e.startsWith(`${t}-`)?e.slice(t.length+1):e)(l.mission.mission_id,e.id)}</a>`:ee`<span class="note">idle</span>`}</td>
<td class="figure spent"><${m} of=${J(l.mission?.energy.battery_j)} /></td>
</tr>`}};function pe({robots:e}){let[t,a,n,s,l,r,o,i]=[0,0,0,0,null,!1,0,0];for(let{state:d}of e.values()){let e=d.measured_power_w??d.modelled_power_w;d.live&&(a+=1,null!==d.charging?(o+=1,i-=Math.min(0,d.measured_power_w??0)):null!==e&&(t+=e,r=!0)),null!==d.mission&&(n+=1,s+=d.mission.energy.battery_j),null!==d.state_of_charge&&(null===l||d.state_of_charge<l.state_of_charge)&&(l=d)}return ee`<dl class="readouts">
<${p} large label="Fleet power" of=${r?U(t):{n:"–",u:""}} channel="measured" />
<${p} large label="Live" of=${`${a}`} note=${`of ${e.size}`} />
<${p} large label="On a mission" of=${`${n}`} />
<${p} large label="Spent in running missions" of=${J(n>0?s:null)} />
${o>0&&ee`<${p} large label="Charging" of=${`${o}`} note=${`at ${V(U(i))}`} />`}
<${p} large label="Lowest charge" of=${H(l?.state_of_charge)} note=${l&&ee`<a href=${c(l.robot_id)}>${l.robot_id}</a>`} />
</dl>`}var ge=null,fe=null;function _e({part:e,...t}){let[,a]=E(0),[n,s]=E(null),l=()=>a(e=>e+1),r=()=>{s(null),document.getElementById("gap-style")||document.head.append(Object.assign(document.createElement("link"),{id:"gap-style",rel:"stylesheet",href:"gap-style.css"})),(ge??=import("./gap.js").then(e=>{fe=e},e=>{throw ge=null,e}),ge).then(l,()=>s({status:0,title:"This part of the page could not be loaded",message:"The service may be restarting, or the network is down."}))};if(D(()=>{null===fe&&r()},[]),null!==n)return ee`<${_} error=${n} retry=${r} />`;if(null===fe)return ee`<${f} what="this part of the page" />`;let o=fe[e];return ee`<${o} ...${t} />`}var be={light:[[200,206,196],[226,178,92],[212,104,44],[150,38,48],[72,14,52]],dark:[[44,58,62],[104,72,104],[196,82,72],[250,152,56],[255,238,170]]},ve={light:[[20,84,140],[120,170,200],[196,196,190],[226,140,100],[172,36,34]],dark:[[70,170,255],[60,106,150],[78,84,84],[176,92,64],[255,120,84]]};function ye(e,t,a,n,s){return{scale:e,width:n,height:s,to:(l,r)=>[n/2+(l-t)*e,s/2-(r-a)*e],from:(l,r)=>[t+(l-n/2)/e,a-(r-s/2)/e]}}function we(e){let t=10**Math.floor(Math.log10(e));return[5,2,1].map(e=>e*t).find(t=>t<=e)??t}function ke(e,t){let a=d(),n=we(90/t.scale),[s,l]=t.from(0,0),[r,o]=t.from(t.width,t.height);e.strokeStyle=a.graticule,e.lineWidth=1,e.beginPath();for(let a=Math.ceil(s/n)*n;a<=r;a+=n){let n=Math.round(t.to(a,0)[0])+.5;e.moveTo(n,0),e.lineTo(n,t.height)}for(let a=Math.ceil(o/n)*n;a<=l;a+=n){let n=Math.round(t.to(0,a)[1])+.5;e.moveTo(0,n),e.lineTo(t.width,n)}e.stroke()}function xe(e,t){let a=d(),n=we(120/t.scale),s=n*t.scale,l=14.5,r=t.height-14.5;e.strokeStyle=e.fillStyle=a.ink,e.lineWidth=1.5,e.beginPath(),e.moveTo(l,r-5),e.lineTo(l,r),e.lineTo(l+s,r),e.lineTo(l+s,r-5),e.stroke(),e.font='12px "Liberation Sans", "Helvetica Neue", Arial, sans-serif',e.textAlign="left",e.textBaseline="alphabetic",e.fillText(`${B(n,1)} m`,l+s+6,r)}function Me(e,t,a,n,s,l){let[r,o]=t.to(a,n);e.save(),e.translate(r,o),e.rotate(-s),e.fillStyle=l,e.strokeStyle=d().screen,e.lineWidth=2,e.beginPath(),e.moveTo(11,0),e.lineTo(-7,7),e.lineTo(-3.5,0),e.lineTo(-7,-7),e.closePath(),e.stroke(),e.fill(),e.restore()}function je({draw:e,height:t,label:a,changes:n,...s}){let l=R(null),r=R(e),o=i();r.current=e;let d=()=>{let e=l.current,a=devicePixelRatio||1,n=e?.clientWidth??0;if(0===n)return;(e.width!==Math.round(n*a)||e.height!==Math.round(t*a))&&(e.width=Math.round(n*a),e.height=Math.round(t*a));let s=e.getContext("2d");s.setTransform(a,0,0,a,0,0),s.clearRect(0,0,n,t),r.current(s,n,t)};return L(()=>{let e=new ResizeObserver(d);return e.observe(l.current),()=>e.disconnect()},[t]),D(d,[o,...n]),ee`<canvas class="floor" role="img" aria-label=${a} ref=${l} style=${{height:`${t}px`}} ...${s}></canvas>`}function Te({points:e,kind:t="power",height:a=380,label:n,cursor:s=null,robot:l=null,legend:o=!0,ends:u=!0,under:c=null}){let h=e.filter(([e,t])=>Number.isFinite(e)&&Number.isFinite(t)),$=i(),m=function(e,t){let a=t.filter(Number.isFinite).map(t=>"gap"===e?Math.abs(t):t).sort((e,t)=>e-t),n=Math.max(a.length>0?a[Math.floor(.98*(a.length-1))]:1,.001),s=10**Math.floor(Math.log10(n))/2,l=Math.ceil(n/s)*s,o="gap"===e?-l:0,i=function(e){let t=[];for(let a=0;a<64;++a){let n=a/63*(e.length-1),s=Math.min(Math.floor(n),e.length-2),l=n-s,r=e[s].map((t,a)=>Math.round(t+(e[s+1][a]-t)*l));t.push(`rgb(${r.join(" ")})`)}return t}(("gap"===e?ve:be)[r()?"dark":"light"]);return{low:o,high:l,colours:i,colour_of:e=>i[Math.max(0,Math.min(63,Math.round((e-o)/(l-o)*63)))]}}(t,h.map(e=>e[2]));return ee`<div class="floor-box">
<${je} draw=${(t,a,n)=>{let r=function(e,t,a,n=28,s=2){let[l,r,o,i]=[1/0,-1/0,1/0,-1/0];for(let[t,a]of e)!Number.isFinite(t)||!Number.isFinite(a)||(l=Math.min(l,t),r=Math.max(r,t),o=Math.min(o,a),i=Math.max(i,a));return l>r&&([l,r,o,i]=[-s,s,-s,s]),ye(Math.min((t-2*n)/Math.max(r-l,s),(a-2*n)/Math.max(i-o,s)),(l+r)/2,(o+i)/2,t,a)}([...h,...l?[l]:[],...c??[]],a,n,34);ke(t,r),null!==c&&function(e,t,a){e.strokeStyle=d().muted,e.lineWidth=1.25,e.setLineDash([5,4]),e.beginPath(),a.forEach(([a,n],s)=>e[0===s?"moveTo":"lineTo"](...t.to(a,n))),e.stroke(),e.setLineDash([])}(t,r,c),t.lineWidth=3.2,t.lineCap="round",t.lineJoin="round";let o=null;for(let e=1;e<h.length;++e){let a=h[e][2],n=Number.isFinite(a)?m.colour_of(a):d().line;n!==o&&(null!==o&&t.stroke(),t.strokeStyle=o=n,t.beginPath(),t.moveTo(...r.to(h[e-1][0],h[e-1][1]))),t.lineTo(...r.to(h[e][0],h[e][1]))}null!==o&&t.stroke(),h.length>1&&u&&function(e,t,a){let n=d(),s=a[0],l=a[a.length-1];e.lineWidth=2,e.strokeStyle=n.ink,e.fillStyle=n.screen;let[r,o]=t.to(s[0],s[1]);e.beginPath(),e.arc(r,o,5,0,7),e.fill(),e.stroke();let[i,u]=t.to(l[0],l[1]);e.fillStyle=n.ink,e.fillRect(i-4.5,u-4.5,9,9)}(t,r,h),l&&Me(t,r,l[0],l[1],l[2]??0,d().ink);let i=null===s?null:e[s];if(i&&Number.isFinite(i[0])){let[e,s]=r.to(i[0],i[1]);t.strokeStyle=d().ink,t.lineWidth=1,t.beginPath(),t.moveTo(e,0),t.lineTo(e,n),t.moveTo(0,s),t.lineTo(a,s),t.stroke(),t.fillStyle=d().accent,t.beginPath(),t.arc(e,s,6,0,7),t.fill(),t.stroke()}xe(t,r)}} height=${a} label=${n} changes=${[e,t,s,l,c]} />
${o&&h.some(e=>e[2]>0||"gap"===t)&&ee`<${Ce} scale=${m} dark=${$} title=${"gap"===t?"measured − modelled":"power"} />`}
</div>`}function Ce({scale:e,title:t,unit:a="W"}){let n=(e.low+e.high)/2;return ee`<div class="legend">
<span class="legend-title">${t}</span>
<span class="number">${B(e.low,2)}</span>
<${je} draw=${(t,a,n)=>{let s=a/e.colours.length;e.colours.forEach((e,a)=>{t.fillStyle=e,t.fillRect(a*s,0,s+1,n)})}} height=${10} label=${`Colours from ${e.low} to ${e.high} ${a}`} changes=${[e.low,e.high,t]} />
<span class="number">${B(e.high,2)}${" "}${a}</span>
${"power"!==t&&ee`<span class="note">neutral at ${B(n,1)}</span>`}
</div>`}var Ne={id:e=>e.id,robot_id:e=>e.robot_id,mission_id:e=>e.mission_id,state:e=>e.state,incomplete:e=>e.incomplete,incomplete_reason:e=>e.incomplete_reason,start_utime_us:e=>e.start_utime_us,end_utime_us:e=>e.end_utime_us,payload_kg:e=>e.payload_kg,model_version:e=>e.model_version,battery_j:e=>e.energy.battery_j,measured_j:e=>e.energy.measured_j,measured_s:e=>e.energy.measured_s,modelled_j:e=>e.energy.modelled_j,unexplained_j:e=>e.energy.unexplained_j,drawn_j:e=>e.energy.drawn_j,returned_j:e=>e.energy.returned_j,charge_ah:e=>e.energy.charge_ah,distance_m:e=>e.energy.distance_m,turned_rad:e=>e.energy.turned_rad,duration_s:e=>e.energy.duration_s,samples:e=>e.samples,gap_count:e=>e.gap_count,gap_s:e=>e.gap_s,note:e=>e.note},Se=e=>`${Object.values(Ne).map(t=>function(e){if(null==e)return"";if("string"!=typeof e)return String(e);let t=/^[=+\-@\t\r]/.test(e)?`'${e}`:e;return/[",\r\n]/.test(t)?`"${t.replaceAll('"','""')}"`:t}(t(e))).join(",")}\r\n`,Pe=e=>e?1e3*new Date(e).getTime():void 0;function Ee(e){return{robot_id:e.robot,mission_id:e.name,state:e.state,incomplete:e.incomplete,from_utime_us:Pe(e.from),to_utime_us:Pe(e.to),payload_min_kg:e.payload_min,payload_max_kg:e.payload_max}}var Oe=({measured_j:e,modelled_j:t})=>null!==e&&0!==t?e/t:null;function De({missions:e,with_robot:t=!0}){return ee`<table class="grid missions">
<thead><tr>
<th scope="col">Started</th>${t&&ee`<th scope="col">Robot</th>`}<th scope="col">Mission</th><th scope="col">State</th>
<th scope="col" class="figure">Duration</th><th scope="col" class="figure">Distance</th><th scope="col" class="figure wide">Payload</th>
<th scope="col" class="figure">Energy</th><th scope="col" class="figure wide">Modelled</th>
<th scope="col" class="figure"><abbr title="measured over modelled energy">Ratio</abbr></th><th scope="col" class="figure wide">Per metre</th>
</tr></thead>
<tbody>${e.map(e=>ee`<tr key=${e.id}>
<td class="when">${Y(e.start_utime_us)}</td>
${t&&ee`<td><a href=${c(e.robot_id)}>${e.robot_id}</a></td>`}
<th scope="row"><a href=${h(e.id)}>${e.mission_id}</a></th>
<td><${k} mission=${e} />${e.incomplete&&ee` <span class="flag" title=${e.incomplete_reason??""}>incomplete</span>`}</td>
<td class="figure">${K(e.energy.duration_s)}</td>
<td class="figure"><${m} of=${G(e.energy.distance_m)} /></td>
<td class="figure wide"><${m} of=${q(e.payload_kg,"kg")} /></td>
<td class="figure"><${m} of=${J(e.energy.battery_j)} /></td>
<td class="figure wide"><${m} of=${J(e.energy.modelled_j)} /></td>
<td class="figure"><${Ae} value=${Oe(e.energy)} /></td>
<td class="figure wide"><${m} of=${e.energy.distance_m>.1?q(e.energy.battery_j/e.energy.distance_m,"J/m"):q(null)} /></td>
</tr>`)}</tbody>
</table>`}function Ae({value:e}){return ee`<span class=${F(e)&&Math.abs(e-1)>.1?"ratio off":"ratio"}>${W(e,3)}</span>`}function Le({given:e,change:t}){let a=[...l().robots.keys()].sort(),n=a=>n=>t({...e,[a]:n.currentTarget.value}),s=(e,t)=>ee`<label class="field"><span>${e}</span>${t}</label>`,r=Object.values(e).some(e=>""!==e&&void 0!==e);return ee`<form class="filters" aria-label="Filter missions" onSubmit=${e=>e.preventDefault()}>
${s("Robot",ee`<select value=${e.robot??""} onChange=${n("robot")}><option value="">all</option>
${e.robot&&!a.includes(e.robot)&&ee`<option value=${e.robot}>${e.robot}</option>`}
${a.map(e=>ee`<option key=${e} value=${e}>${e}</option>`)}</select>`)}
${s("From",ee`<input type="datetime-local" value=${e.from??""} onChange=${n("from")} />`)}
${s("To",ee`<input type="datetime-local" value=${e.to??""} onChange=${n("to")} />`)}
<fieldset class="field"><legend>Payload, kg</legend><span class="with-unit">
<input class="short" type="number" min="0" step="any" aria-label="Payload, from kg" placeholder="from" value=${e.payload_min??""} onChange=${n("payload_min")} />
<input class="short" type="number" min="0" step="any" aria-label="Payload, to kg" placeholder="to" value=${e.payload_max??""} onChange=${n("payload_max")} /></span></fieldset>
${s("State",ee`<select value=${e.state??""} onChange=${n("state")}><option value="">all</option>${w.map(e=>ee`<option key=${e} value=${e}>${e}</option>`)}</select>`)}
${s("Measured",ee`<select value=${e.incomplete??""} onChange=${n("incomplete")}><option value="">all</option><option value="false">complete</option><option value="true">incomplete</option></select>`)}
${s("Named",ee`<input type="text" value=${e.name??""} onChange=${n("name")} />`)}
<button type="button" class="plain" disabled=${!r} onClick=${()=>t({})}>Clear</button>
</form>`}function Re({told:e}){return ee`<${b} of=${e} what="totals">${e=>{let t=e.energy,a=e.missions>0;return ee`<dl class="readouts">
<${p} label="Missions" of=${W(e.missions)} note=${e.incomplete_missions>0?`${W(e.incomplete_missions)} incomplete`:""} />
<${p} label="Energy from the batteries" of=${J(a?t.battery_j:null)} channel="measured" />
<${p} label="Modelled" of=${J(a?t.modelled_j:null)} channel="modelled" />
<${p} label="Unexplained" of=${J(t.unexplained_j)} channel="gap" note=${null!==t.unexplained_j&&0!==t.battery_j?`${W(100*t.unexplained_j/t.battery_j,1)} %`:""} />
<${p} label="Distance" of=${G(t.distance_m)} />
<${p} label="Per metre" of=${q(t.distance_m>0?t.battery_j/t.distance_m:null,"J/m")} />
<${p} label="Driving" of=${K(t.duration_s)} />
</dl>`}}<//>`}function ze({given:e,total:a}){let[n,s]=E(null),[l,r]=E(null),o=R(null);D(()=>()=>o.current?.abort(),[]);let i=async a=>{o.current=new AbortController,r(null),s(0);try{await async function(e,a,n,s){let l,r=["csv"===e?`${Object.keys(Ne).join(",")}\r\n`:"[\n"],o=0;do{let i=await te(`/v1/missions${t({...a,limit:1e3,cursor:l})}`,s);i.missions.length>0&&("csv"===e?r.push(i.missions.map(Se).join("")):r.push((o>0?",\n":"")+i.missions.map(e=>JSON.stringify(e)).join(",\n"))),o+=i.missions.length,l=i.next_cursor,n(o)}while(null!==l);"json"===e&&r.push("\n]\n"),function(e,t,a){let n=URL.createObjectURL(new Blob(e,{type:a})),s=Object.assign(document.createElement("a"),{href:n,download:t});document.body.append(s),s.click(),s.remove(),setTimeout(()=>URL.revokeObjectURL(n),6e4)}(r,`joulecast-missions-${(new Date).toISOString().slice(0,19).replaceAll(":","")}.${e}`,"csv"===e?"text/csv":"application/json")}(a,Ee(e),s,o.current.signal)}catch(e){"AbortError"!==e.name&&r(e)}s(null)};return null!==n?ee`<div class="export" role="status">
<progress max=${a||1} value=${n}></progress> ${W(n)} of ${W(a)}
<button type="button" onClick=${()=>o.current.abort()}>Stop</button></div>`:ee`<div class="export">${l&&ee`<span class="fault" role="alert">${l.message}</span>`}
<button type="button" disabled=${!a} onClick=${()=>i("csv")}>Export CSV</button>
<button type="button" disabled=${!a} onClick=${()=>i("json")}>Export JSON</button></div>`}function Fe({model:e}){return ee`<details class="model"><summary>Parameters in force</summary>
<table class="facts"><tbody>${Object.entries(A(e)).filter(([e])=>"robot_id"!==e).map(([e,t])=>ee`<tr key=${e}><th scope="row"><code>${e}</code></th><td>${t}</td></tr>`)}</tbody></table></details>`}function We({entry:e}){let t=e.state.mission?.id,a=n(t?`/v1/missions/${t}/trace?points=600`:null),[s]=E({mission:null,rows:[]});s.mission!==t&&Object.assign(s,{mission:t,rows:[]});let l=e.path.last(),r=[...t&&a.value&&a.value.id===t?a.value.x_m.map((e,t)=>[e??NaN,a.value.y_m[t]??NaN,a.value.measured_power_w.mean[t]??a.value.modelled_power_w.mean[t]??NaN]):[],...l.map(([e,t,,a])=>[e,t,a])],[o,i,d]=e.state.pose;return 0===r.length||null===o?ee`<${g} title="No position">${null===e.state.silent_s?"Nothing heard yet.":"This robot does not tell where it is."}<//>`:ee`<${Te} points=${r} height=${340} ends=${!1} robot=${[o,i,d??0]} label=${`Path of ${e.id} so far, coloured by power, and where it is now`} />`}function Be({rows:e,label:t}){let a=Math.max(...e.map(e=>e.value??0),1e-9);return ee`<table class="bars" aria-label=${t}><tbody>${e.map(e=>ee`<tr key=${e.name}>
<th scope="row">${e.name}</th>
<td class="bar-cell"><svg width="100%" height="18" aria-hidden="true" focusable="false"><rect class=${`account ${e.channel}`} x="0" y="3" height="12" width=${100*Math.max(0,e.value??0)/a+"%"} /></svg></td>
<td class="figure"><${m} of=${e.of} /></td>
<td class="note">${e.note}</td></tr>`)}</tbody></table>`}var Ie={accessories:"Idle and accessories",driver:"Motor drivers",copper:"Copper",brush:"Brushes",friction_internal:"Friction in motors and gears",friction_rolling:"Rolling",friction_scrub:"Scrub in turns",friction_zone:"Floor zones",friction_slip:"Wheel slip",drag:"Air",kinetic:"Change of motion",potential:"Change of height",braking:"Generated in braking",recovered:"Recovered",sensor:"Sensor fault",unexplained:"Unexplained"};function Je({terms_j:e,battery_j:t,closure:a,measured:n=!0}){let{rows:s,sum:l,absent:r}=function(e,t){let a=e=>Math.abs(e)<=1e-5*Math.abs(t),n=[],s=0;for(let[t,l]of Object.entries(e)){let e="recovered"===t?-l:l;"unexplained"===t&&n.push({key:"modelled",name:"Modelled",from:0,to:s,total:!0}),a(l)&&"unexplained"!==t||n.push({key:t,name:Ie[t]??Q(t),from:s,to:s+e,change:e}),s+=e}return{rows:n,sum:s,absent:Object.entries(e).filter(([e,t])=>a(t)&&"unexplained"!==e).map(([e])=>(Ie[e]??e).toLowerCase())}}(e,t),o=n?s:s.filter(e=>"unexplained"!==e.key&&"modelled"!==e.key),i=o.flatMap(e=>[e.from,e.to]).concat(t,0),d=Math.min(...i),u=Math.max(...i),c=Math.max(u-d,1e-9),h=e=>(e-d)/c*100,$=[...o,{key:"battery",name:n?"From the battery":"Total",from:0,to:t,total:!0}];return ee`<div class="waterfall">
<svg class="patterns" width="0" height="0" aria-hidden="true" focusable="false"><defs><pattern id="hatch" width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)"><rect class="hatch-back" width="6" height="6" /><line class="hatch-line" x1="0" x2="0" y1="0" y2="6" /></pattern></defs></svg>
<table>
<thead class="hidden"><tr><th scope="col">Account</th><th scope="col">Bar</th><th scope="col">Energy</th><th scope="col">Share</th></tr></thead>
<tbody>
${$.map(e=>{let a=e.total?e.to:e.change;return ee`<tr key=${e.key} class=${e.total?`total ${e.key}`:"unexplained"===e.key?"odd":""}>
<th scope="row">${e.name}</th>
<td class="bar-cell">${(e=>{let a=Math.min(h(e.from),h(e.to)),n=Math.abs(h(e.to)-h(e.from));return ee`<svg class="bar" width="100%" height=${30} aria-hidden="true" focusable="false">
<line class="zero" x1=${`${h(0)}%`} x2=${`${h(0)}%`} y1="0" y2=${30} />
<line class="goal" x1=${`${h(t)}%`} x2=${`${h(t)}%`} y1="0" y2=${30} />
${"battery"!==e.key&&ee`<line class="step" x1=${`${h(e.to)}%`} x2=${`${h(e.to)}%`} y1=${23} y2=${30} />`}
<rect class=${`account ${e.total?e.key:"unexplained"===e.key?"unexplained":e.change<0?"back":"out"}`}
x=${`${a}%`} y="7" width=${`${Math.max(n,.15)}%`} height=${16} />
</svg>`})(e)}</td>
<td class="figure"><${m} of=${J(a)} sign=${!e.total} /></td>
<td class="figure share">${0!==t?W(100*a/t,1):"–"}${" "}%</td>
</tr>`})}
</tbody>
</table>
<p class="closing">
Accounts add up to <b>${W(l,2)}${" "}J</b>; the battery gave <b>${W(t,2)}${" "}J</b>.
${void 0!==a&&ee` ${a<1e-9?"Closes":"Does not close"}: difference ${0===a?"none":a.toExponential(1)} of the whole.`}
${r.length>0&&ee` <span class="note">Next to nothing in: ${r.join(", ")}.</span>`}
</p>
</div>`}var Ue=(e,t)=>t.map(e=>{if(null===e)return"";let t=e<0?"−":"",a=Math.abs(e),n=e=>String(Math.floor(e)).padStart(2,"0");return a<3600?`${t}${Math.floor(a/60)}:${n(a%60)}`:`${t}${Math.floor(a/3600)}:${n(a%3600/60)}:${n(a%60)}`});function Ge({trace:t,mission:a,zoom:n,set_zoom:s,set_cursor:l}){let[r,o]=z(()=>{let e=(...e)=>function(e,t,a){let n=function(e,t){return e.start_utime_us.map(a=>(a-t+e.width_us/2)/1e6)}(e,t),s=[];for(let t=1;t<n.length;++t)e.start_utime_us[t]-e.start_utime_us[t-1]>1.9*e.width_us&&s.push(t);if(0===s.length)return[n,...a];let l=(e,t)=>{let a=[];return e.forEach((n,l)=>{s.includes(l)&&a.push(void 0===t?(e[l-1]+n)/2:t),a.push(n)}),a};return[l(n),...a.map(e=>l(e,null))]}(t,a.start_utime_us,e.flatMap(e=>[e.max,e.min,e.mean]));return[e(t.measured_power_w,t.modelled_power_w),e(t.speed_m_s)]},[t]),i=R(t);i.current=t;let u={setCursor:[e=>l(null===e.cursor.idx||void 0===e.cursor.idx?null:qe(i.current,a.start_utime_us+1e6*e.data[0][e.cursor.idx]))],setSelect:[e=>{e.select.width<6||(s([e.posToVal(e.select.left,"x"),e.posToVal(e.select.left+e.select.width,"x")]),e.setSelect({left:0,top:0,width:0,height:0},!1))}]},c={...O("mission"),drag:{x:!0,y:!1,setScale:!1,dist:6},bind:{dblclick:()=>()=>s(null)}},h=t=>j(t,{size:28,incrs:e,values:Ue}),$=R([]),m=R(0);return ee`<div class="charts" tabindex="0" role="group" aria-label="Power and speed over time. Left and right move the cursor, plus looks closer, minus shows the whole mission." onKeyDown=${e=>{let t=$.current[0].data[0],a=Math.max(1,Math.round(t.length/20)),n=e.shiftKey?a:1,l={ArrowLeft:m.current-n,ArrowRight:m.current+n,Home:0,End:t.length-1}[e.key],r=t[t.length-1]-t[0],o=t[Math.min(m.current,t.length-1)];if(void 0!==l){m.current=Math.max(0,Math.min(t.length-1,l));for(let e of $.current)e.setCursor({left:e.valToPos(t[m.current],"x"),top:8})}else if("+"===e.key&&r>4)s([Math.max(t[0],o-r/4),Math.min(t[t.length-1],o+r/4)]);else{if("-"!==e.key&&"Escape"!==e.key)return;s(null)}e.preventDefault()}}>
<${N} make=${()=>{let e=d(),t={show:!0,stroke:"transparent",points:{show:!1}};return{cursor:c,hooks:u,scales:{x:{time:!1}},axes:[h(""),j("power, W")],bands:[{series:[1,2],fill:P(e.measured,.2)},{series:[4,5],fill:P(e.modelled,.16)}],series:[{},t,t,{stroke:e.measured,width:2.75,points:{show:!1}},t,t,{stroke:e.modelled,width:1,points:{show:!1}}]}}} data=${r} height=${270} changes=${[a.id]} onReady=${e=>{$.current[0]=e}} label="Battery power over the mission, measured and modelled, with the least and greatest of each span" />
<${N} make=${()=>{let e=d(),t={stroke:"transparent",points:{show:!1}};return{cursor:c,hooks:u,scales:{x:{time:!1}},axes:[h("time since the start"),j("speed, m/s")],bands:[{series:[1,2],fill:P(e.ink,.12)}],series:[{},t,t,{stroke:e.ink,width:1.5,points:{show:!1}}]}}} data=${o} height=${150} changes=${[a.id]} onReady=${e=>{$.current[1]=e}} label="Speed over the mission" /></div>`}function He({trace:e,mission:t,index:a}){let n=null!==a&&a<e.start_utime_us.length?a:null,s=(e,t)=>null===n?{n:"–",u:""}:t(e[n]),l=e.measured_power_w,r=e.modelled_power_w,o=null===n||null===l.mean[n]?null:l.mean[n]-r.mean[n];return ee`<dl class="readouts strip" aria-live="off">
<${p} label="Time" of=${null===n?"–":K((e.start_utime_us[n]-t.start_utime_us)/1e6)} />
<${p} label="Measured" channel="measured" of=${s(l.mean,U)} note=${null!==n&&null!==l.mean[n]?`${W(l.min[n],0)} to ${W(l.max[n],0)}`:""} />
<${p} label="Modelled" channel="modelled" of=${s(r.mean,U)} />
<${p} label="Gap" channel="gap" of=${(()=>{let e=U(o);return{n:I(e.n),u:e.u}})()} />
<${p} label="Speed" of=${s(e.speed_m_s.mean,e=>q(e,"m/s",2))} />
<${p} label="Charge" of=${s(e.state_of_charge,e=>H(e,2))} />
</dl>`}function qe(e,t){let a=Math.floor((t-e.start_utime_us[0])/e.width_us),n=Math.max(0,Math.min(a,e.start_utime_us.length-1));for(;n>0&&e.start_utime_us[n]>t;)n-=1;return n}function Ve({mission:e,whole:a,fine:s}){let[l,r]=E(null),[o,i]=E(null),[d,u]=E("power"),c=t=>Math.round(e.start_utime_us+1e6*t),h=n(null===l?null:`/v1/missions/${e.id}/trace${t({points:700,from_utime_us:c(l[0]),to_utime_us:c(l[1])})}`),$=null!==l&&null!==h.value&&h.value.start_utime_us.length>1?h.value:a,m=a.measured_power_w.mean.some(e=>null!==e),p=$===a?s:$,f=z(()=>p.x_m.map((e,t)=>{let a=p.measured_power_w.mean[t],n=p.modelled_power_w.mean[t];return[e??NaN,p.y_m[t]??NaN,"gap"===d?null===a?NaN:a-n:a??n??NaN]}),[p,d]),_=null===o||o>=$.start_utime_us.length?null:qe(p,$.start_utime_us[o]+$.width_us/2),b=f.some(([e])=>Number.isFinite(e));return 0===a.start_utime_us.length?ee`<${v} title="Power"><${g} title="No trace kept">The mission ended before its first sample was stored.<//><//>`:ee`<div class="columns trace-columns">
<${v} class="screen" title="Power and speed" aside=${ee`
<span class="key"><span class="swatch measured"></span>measured <span class="swatch modelled"></span>modelled <span class="swatch band"></span>least to greatest</span>
${null===l?ee`<span class="note">drag or press + to look closer</span>`:ee`<button type="button" onClick=${()=>r(null)}>Whole mission</button>`}`}>
<${Ge} trace=${$} mission=${e} zoom=${l} set_zoom=${r} set_cursor=${i} />
<${He} trace=${$} mission=${e} index=${o} />
<p class="note foot">Each point is ${K($.width_us/1e6)}${null!==l?", closer view":""}.</p>
<//>
<${v} class="screen" title="On the floor" aside=${ee`<${y} label="Colour by" value=${d} onChange=${u} options=${m?[["power","Power"],["gap","Gap"]]:[["power","Power"]]} />`}>
${b?ee`<${Te} points=${f} kind=${d} cursor=${_} height=${440} label=${`Path of the mission, coloured by ${"gap"===d?"measured minus modelled power":"power"}; circle: start, square: end`} />
<p class="note foot">○ start  ■ end. Poses as the robot told them.</p>`:ee`<${g} title="No poses">This robot did not tell where it was.<//>`}
<//>
</div>`}function Ke({mission:e,trace:t}){let s=n(`/v1/robots/${a(e.robot_id)}`),l=s.value?.model.idle_power_w,r=z(()=>void 0===l?null:function(e,t,a){let{distance_m:n,duration_s:s}=e.energy,{runs:l,stood_at_end_s:r}=function(e,t){let a=[],n=null,s=null,l=0;return e.speed_m_s.mean.forEach((r,o)=>{let i=Math.abs(r??0),[d,u]=[e.x_m[o],e.y_m[o]],c=e.covered_s[o]??0;if(i<=.02?(n=null,e.modelled_power_w.mean[o]<=1.05*t&&(l+=c)):(null===n&&(a.push(n={length_m:0,stood_s:l,first:NaN,last:NaN}),l=0),n.length_m+=i*c),null===d||null===u||(null===s&&(s=[d,u]),Math.hypot(d-s[0],u-s[1])<.05))return;let h=Math.atan2(u-s[1],d-s[0]),$=n??a[a.length-1];void 0!==$&&(Number.isNaN($.first)&&($.first=h),$.last=h),s=[d,u]}),{runs:a.filter(({length_m:e})=>e>=.05),stood_at_end_s:l}}(t,a);if(0===l.length||l.length>400||n<.05)return null;let o=l.reduce((e,t)=>e+t.length_m,0),i=e=>e>.2?[{kind:"dwell",duration_s:e}]:[];return{path:[...l.flatMap((e,t)=>{let a=0===t?NaN:function(e,t){let a=t-e;return Math.atan2(Math.sin(a),Math.cos(a))}(l[t-1].last,e.first);return[...i(e.stood_s),...Math.abs(a)>.02?[{kind:"turn",angle_rad:a}]:[],{kind:"straight",length_m:e.length_m/o*n}]}),...i(r)],payload_kg:e.payload_kg??0,deadline_s:s,columns:!1}}(e,t,l),[e.id,e.state,l]),[o,i]=E({value:null,error:null});D(()=>{if(null===r)return;let t=new AbortController;return ae(`/v1/robots/${a(e.robot_id)}/profile`,r,t.signal).then(e=>i({value:e,error:null}),e=>"AbortError"===e.name||i({value:null,error:e})),()=>t.abort()},[r]);let d=null===s.value?s.error:o.error;if(null!==d)return ee`<${_} error=${d} />`;if(null!==s.value&&null===r)return ee`<${g} title="Nothing to compare">The robot did not drive, or in too many short runs.<//>`;if(null===o.value)return ee`<${f} what="the minimum-energy drive" />`;let u=e.energy,c=o.value,h=1-c.energy_j/u.modelled_j,$=r.path.reduce((e,t)=>e+Math.abs(t.angle_rad??0),0),m=r.path.reduce((e,t)=>e+(t.duration_s??0),0),p=r.path.filter(e=>"straight"===e.kind).length;return ee`
<p class="verdict">${h>.005?ee`The same legs could have been driven for <b>${W(100*h,1)}${" "}%</b> less.`:h>-.005?"Driven about as cheaply as the model allows.":"Driven for less than these legs cost from stop to stop: the robot turned while it drove."}</p>
<${Be} label="Energy of the mission and of the minimum-energy drive" rows=${[{name:"Measured",value:u.measured_j,of:J(u.measured_j),channel:"measured",note:K(u.duration_s)},{name:"Modelled",value:u.modelled_j,of:J(u.modelled_j),channel:"modelled",note:K(u.duration_s)},{name:"Least energy",value:c.energy_j,of:J(c.energy_j),channel:"least",note:K(c.duration_s)}]} />
<p class="note foot">${p} ${1===p?"leg":"legs"} between stops, ${V(G(u.distance_m))} in all, ${W(180*$/Math.PI)}° turned at the stops,${m>0?` ${K(m)} standing as the mission did,`:""}${" "}payload ${V(q(e.payload_kg??0,"kg"))}, arriving no later. Model version ${c.model_version}; the saving is against the modelled energy, so that a gap of the model does not count as one.</p>`}function Xe({mission:e}){let t=Object.entries(e.sample_faults),a=(e,t)=>ee`<tr><th scope="row">${e}</th><td>${t}</td></tr>`,n=e.energy;return ee`<table class="facts"><tbody>
${a("Robot",ee`<a href=${c(e.robot_id)}>${e.robot_id}</a>`)}
${a("Started",Y(e.start_utime_us))}
${a("open"===e.state?"Last heard":"Ended",Y(e.end_utime_us))}
${a("Announced",e.implicit?"no: opened by its telemetry":"by the robot")}
${a("Model",null===e.model_version?"none":`version ${e.model_version}`)}
${a("Samples",W(e.samples))}
${a("Gaps",0===e.gap_count?"none":`${e.gap_count}, ${K(e.gap_s)} in all`)}
${a("Faulty samples",0===t.length?"none":t.map(([e,t])=>`${t} ${Q(e)}`).join(", "))}
${a("Battery measured",`${K(n.measured_s)} of ${K(n.duration_s)}`)}
${a("Drawn · returned",`${V(J(n.drawn_j))} · ${V(J(n.returned_j))}`)}
${a("Charge",V(q(1e3*n.charge_ah,"mAh")))}
${a("Motors measured",null===n.measured_motor_j[0]?"–":`right ${V(J(n.measured_motor_j[0]))}, left ${V(J(n.measured_motor_j[1]))}`)}
${a("Motors modelled",`right ${V(J(n.modelled_motor_j[0]))}, left ${V(J(n.modelled_motor_j[1]))}`)}
${e.note&&a("Note",e.note)}
</tbody></table>`}var Ye=Math.PI/180,Ze={straight:{name:"Straight",fields:{length:{label:"length",unit:"m",min:.01,start:5}}},turn:{name:"Turn in place",fields:{angle:{label:"angle, left positive",unit:"°",start:90}}},arc:{name:"Arc",fields:{radius:{label:"radius",unit:"m",min:.01,start:2},angle:{label:"angle, left positive",unit:"°",start:90}}},dwell:{name:"Dwell",fields:{duration:{label:"time",unit:"s",min:0,start:10}}},payload:{name:"Payload from here",fields:{mass:{label:"payload",unit:"kg",min:0,start:10}}}};function Qe(e){return{kind:e,...Object.fromEntries(Object.entries(Ze[e].fields).map(([e,t])=>[e,t.start]))}}function et(e){switch(e.kind){case"turn":return{kind:"turn",angle_rad:e.angle*Ye};case"arc":return{kind:"arc",radius_m:e.radius,angle_rad:e.angle*Ye};case"dwell":return{kind:"dwell",duration_s:e.duration};case"payload":return{kind:"payload",payload_kg:e.mass};default:return{kind:"straight",length_m:e.length}}}function tt(e){let[[t,a],n]=e;return{start_pose:{x_m:t,y_m:a,heading_rad:Math.atan2(n[1]-a,n[0]-t)},path:[{kind:"polyline",points:e.slice(1).map(([e,t])=>({x_m:e,y_m:t}))}]}}var at=.25,nt=e=>Math.round(e/at)*at;function st({points:e,change:t,height:a=400}){let[n,s]=E(16),[l,r]=E(null),o=R(null),i=R(null),u=e=>{let t=e.currentTarget.getBoundingClientRect();return[e.clientX-t.left,e.clientY-t.top]},c=e=>i.current.from(...e).map(nt),h=a=>{let n=e[e.length-1];(!n||n[0]!==a[0]||n[1]!==a[1])&&t([...e,a])},$=()=>{o.current=null};return ee`<div class="draw">
<${je} draw=${(t,a,s)=>{let r=i.current=ye(a/n,0,0,a,s),o=d();if(ke(t,r),t.strokeStyle=t.fillStyle=o.accent,t.lineWidth=3,t.lineJoin="round",t.beginPath(),e.forEach(([e,a],n)=>t[0===n?"moveTo":"lineTo"](...r.to(e,a))),t.stroke(),e.forEach(([a,n],s)=>{t.beginPath(),t.arc(...r.to(a,n),5,0,7),t.fillStyle=s===e.length-1?o.accent:o.screen,t.fill(),t.stroke()}),e.length>0&&Me(t,r,e[0][0],e[0][1],e.length>1?Math.atan2(e[1][1]-e[0][1],e[1][0]-e[0][0]):0,o.ink),l){let[e,a]=r.to(...l);t.strokeStyle=o.ink,t.lineWidth=1,t.beginPath(),t.moveTo(e-12,a),t.lineTo(e+12,a),t.moveTo(e,a-12),t.lineTo(e,a+12),t.stroke()}xe(t,r)}} height=${a} changes=${[e,n,l]} role="application" tabindex="0"
label=${`Drawing of the path, ${e.length} points. Arrow keys move the cross, Enter adds a point, Backspace removes the last.${l?` Cross at ${B(l[0],3)}, ${B(l[1],3)} metres.`:""}`}
onPointerDown=${t=>{let a=u(t),n=(([t,a])=>e.findIndex(([e,n])=>{let[s,l]=i.current.to(e,n);return Math.hypot(t-s,a-l)<12}))(a);t.currentTarget.setPointerCapture(t.pointerId),n>=0?o.current=n:(h(c(a)),o.current=e.length)}} onPointerMove=${a=>{if(null===o.current)return;let n=c(u(a)),s=e[o.current];s&&(s[0]!==n[0]||s[1]!==n[1])&&t(e.map((e,t)=>t===o.current?n:e))}} onPointerUp=${$} onPointerCancel=${$} onKeyDown=${a=>{let n=a.shiftKey?1:at,s={ArrowLeft:[-n,0],ArrowRight:[n,0],ArrowUp:[0,n],ArrowDown:[0,-n]}[a.key],o=l??e[e.length-1]??[0,0];if(s)r([o[0]+s[0],o[1]+s[1]]);else if("Enter"===a.key)h(o);else{if("Backspace"!==a.key&&"Delete"!==a.key)return;t(e.slice(0,-1))}a.preventDefault()}} />
<div class="tools"><button type="button" onClick=${()=>t(e.slice(0,-1))} disabled=${0===e.length}>Undo point</button>
<button type="button" onClick=${()=>t([])} disabled=${0===e.length}>Clear</button>
<button type="button" onClick=${()=>s(n/2)} disabled=${n<=4} aria-label="Closer">+</button>
<button type="button" onClick=${()=>s(2*n)} disabled=${n>=256} aria-label="Wider">−</button>
<span class="note">Press to add, drag to move; snaps to ${at} m. Corners are turned in place.</span></div>
</div>`}var lt=()=>[{kind:"straight",length:6},{kind:"turn",angle:90},{kind:"straight",length:4}];function rt({legs:e,change:t,fault:a}){let n=(a,n)=>{let s=[...e];[s[a],s[a+n]]=[s[a+n],s[a]],t(s)};return ee`<fieldset class="legs"><legend>Legs</legend><ol>
${e.map((s,l)=>ee`<li key=${l} class=${a===l?"faulty":""}>
<select aria-label=${`Kind of leg ${l+1}`} value=${s.kind} onChange=${a=>t(e.map((e,t)=>t===l?Qe(a.currentTarget.value):e))}>
${Object.entries(Ze).map(([e,{name:t}])=>ee`<option key=${e} value=${e}>${t}</option>`)}</select>
<span class="leg-fields">${Object.entries(Ze[s.kind].fields).map(([a,n])=>ee`<label key=${a} class="inline"><span class="hidden">${`Leg ${l+1}, ${n.label}`}</span>
<input type="number" step="any" min=${n.min} required title=${n.label} value=${s[a]} onInput=${n=>((a,n)=>t(e.map((e,t)=>t===a?{...e,...n}:e)))(l,{[a]:n.currentTarget.valueAsNumber})} /><span class="unit">${n.unit}</span></label>`)}</span>
<span class="leg-tools"><button type="button" class="plain" disabled=${0===l} aria-label=${`Move leg ${l+1} up`} onClick=${()=>n(l,-1)}>↑</button>
<button type="button" class="plain" disabled=${l===e.length-1} aria-label=${`Move leg ${l+1} down`} onClick=${()=>n(l,1)}>↓</button>
<button type="button" class="plain" disabled=${1===e.length} aria-label=${`Remove leg ${l+1}`} onClick=${()=>t(e.filter((e,t)=>t!==l))}>×</button></span></li>`)}
</ol><button type="button" onClick=${()=>t([...e,Qe("straight")])}>Add a leg</button></fieldset>`}function ot(e,t,a){if(!t)return e.map(()=>null);let n=t.time_s,s=t[a],l=1;return e.map(e=>{for(;l<n.length-1&&n[l]<e;)l+=1;let t=n[l]>n[l-1]?Math.max(0,Math.min(1,(e-n[l-1])/(n[l]-n[l-1]))):1;return s[l-1]+t*(s[l]-s[l-1])})}function it({answer:e}){let t=e.profile,a=t.yaw_rate_rad_s.some(e=>Math.abs(e)>1e-6),{trapezoid:n,triangle:s}=e.baselines,l=z(()=>[t.time_s,t.speed_m_s,ot(t.time_s,n?.profile,"speed_m_s"),ot(t.time_s,s?.profile,"speed_m_s"),a?t.yaw_rate_rad_s:t.time_s.map(()=>null)],[e]),r=z(()=>[t.time_s,t.power_w],[e]),o={sync:{key:"plan"},drag:{x:!1,y:!1}};return ee`
<${N} make=${()=>{let e=d(),t={show:!1};return{cursor:o,scales:{x:{time:!1},yaw:{}},axes:[j("",{size:28}),j("speed, m/s"),...a?[j("yaw rate, rad/s",{scale:"yaw",side:1,grid:{show:!1}})]:[]],series:[{},{stroke:e.accent,width:2.25,points:t},{stroke:e.muted,width:1.25,dash:[6,4],points:t},{stroke:e.muted,width:1.25,dash:[2,3],points:t},{stroke:e.modelled,width:1.25,scale:a?"yaw":"y",points:t}]}}} data=${l} height=${210} changes=${[a]} label=${`Speed over ${K(e.duration_s)}, greatest ${W(e.peak_speed_m_s,2)} metres a second`} />
<${N} make=${()=>{let e=d();return{cursor:o,scales:{x:{time:!1}},axes:[j("time, s",{size:28}),j("power, W"),...a?[j(" ",{scale:"y",side:1,grid:{show:!1},ticks:{show:!1},values:()=>[]})]:[]],series:[{},{stroke:e.accent,width:1.75,fill:P(e.accent,.12),points:{show:!1}}]}}} data=${r} height=${150} changes=${[a]} label="Battery power of the optimal profile over time" />
<p class="note foot"><span class="swatch accent"></span>least energy ${a&&ee`<span class="swatch modelled"></span>yaw rate `}<span class="swatch dashed"></span>trapezoid <span class="swatch dotted"></span>triangle</p>`}function dt({answer:e,take:t}){let a=e.pareto,{trapezoid:n,triangle:s}=e.baselines,l=z(()=>{let t=[a,[e],[n],[s]].map(e=>new Map(e.filter(Boolean).map(e=>[e.duration_s,e.energy_j]))),l=[...new Set(t.flatMap(e=>[...e.keys()]))].sort((e,t)=>e-t);return[l,...t.map(e=>l.map(t=>e.get(t)??null))]},[e]),[r,o]=E(0),i=a[Math.min(r,a.length-1)];return ee`<${N} make=${()=>{let e=d(),t=(e,t,a)=>({stroke:"transparent",paths:()=>null,points:{show:!0,size:t,width:2,stroke:e,fill:a}});return{scales:{x:{time:!1}},cursor:{y:!1,drag:{x:!1,y:!1},points:{show:!1}},axes:[j("duration, s",{size:28,space:70}),j("energy, J",{size:58})],series:[{},{stroke:e.modelled,width:1.5,spanGaps:!0,points:{show:!0,size:5,fill:e.modelled}},t(e.accent,12,e.accent),t(e.muted,9,e.screen),t(e.muted,9,e.muted)]}}} data=${l} height=${230} changes=${[]} label=${`Energy against duration, from ${K(a[0].duration_s)} to ${K(a[a.length-1].duration_s)}`} />
<p class="note foot"><span class="swatch accent dot"></span>this plan <span class="swatch hollow dot grey"></span>trapezoid <span class="swatch grey dot"></span>triangle <span class="swatch modelled"></span>front</p>
<div class="front-pick"><label><span>Walk the front</span><input type="range" min="0" max=${a.length-1} value=${r} onInput=${e=>o(e.currentTarget.valueAsNumber)} aria-valuetext=${`${K(i.duration_s)}, ${V(J(i.energy_j))}`} /></label>
<span class="number">${W(i.duration_s,1)} s · ${V(J(i.energy_j))}; a second less costs ${ut(i.time_multiplier_w)}</span>
<button type="button" onClick=${()=>t(i)}>Take as deadline</button></div>`}var ut=e=>0!==e&&Math.abs(e)<.005?"less than 0.01 J":V(J(e)),ct={closed_form:"formulas",interior_point:"an interior-point method",mixed:"formulas and an interior-point method"};function ht(e){if(!e)return"not possible here";let t=e.saving_fraction,a=V(H(Math.abs(t),1));return e.within_limits?t>=0?`we save ${a}`:`costs ${a} less`:`breaks the limits, and costs ${a} ${t>=0?"more":"less"}`}function $t({answer:e}){let t=e.certificate,a=(e,t)=>ee`<tr><th scope="row">${e}</th><td>${t}</td></tr>`;return ee`<table class="facts"><tbody>
${a("Found by",ct[t.method]??Q(t.method))}
${a("At most above the optimum",ut(t.gap_j))}
${a("Error of the time steps",ut(t.discretisation_j))}
${a("A global optimum",t.convex?"yes: the problem is convex":"not proven: the problem is not convex")}
${a("A second less costs",ut(t.time_multiplier_w))}
${a("Limits met",0===t.binding.length?"none":t.binding.map(Q).join(", "))}
${a("Braking",`${V(J(e.braking_j))}, of which ${V(J(e.recovered_j))} returns`)}
${a("Peak power",V(U(e.peak_power_w)))}
${a("Model",`version ${e.model_version}`)}
</tbody></table>`}function mt({answer:e,autonomy:t}){if(null!==t.error)return ee`<${_} error=${t.error} />`;if(null===t.value)return ee`<p class="verdict open">The robot has not told its charge: enter it to see whether the robot makes it.</p>`;let a=t.value,n=a.usable_energy_j-e.energy_j,s=n>=0,l=a.state_of_charge-a.reserve_fraction,r=l>0?a.state_of_charge-l*e.energy_j/a.usable_energy_j:null,o=e.energy_j>0?Math.floor(a.usable_energy_j/e.energy_j):null;return ee`<div class=${"verdict-box "+(s?"makes":"fails")}>
<p class="verdict"><b>${s?"The robot makes it":"The robot does not make it"}</b>${s?ee`: arrives with ${V(H(r,r>.995?2:1))} charge, ${V(J(n))} above its reserve of ${V(H(a.reserve_fraction))}.`:ee`: ${V(J(-n))} short of its reserve of ${V(H(a.reserve_fraction))}.`}</p>
<p class="note">Starts with ${V(H(a.state_of_charge,1))}, ${V(J(a.usable_energy_j))} usable${o>=2?`: ${W(o)} such drives`:""}. At its ${"model"===a.consumption.basis?"modelled":"recent"} consumption it has ${V(G(a.range_m))} or ${K(a.run_time_s)} left.</p></div>`}var pt={fleet:function(){M("Fleet");let e=l(),t=i(),a=se(),[n,s]=E(""),[r,o]=E("all"),[d,u]=E({key:"robot",down:!1}),[c,h]=E(!1),$=[...e.robots.values()].filter(e=>ue(e.state)).length,m="all"===r&&""===n&&$>0&&$<e.robots.size,p=function(e,t,a,n){let s=R({key:"",at:-1/0,rows:[]}),l=`${t}|${a}|${n.key}|${n.down}|${e.robots.size}|${e.loads}`,r=performance.now();if(s.current.key!==l||r-s.current.at>3e3){let o=de.find(e=>e.key===n.key),i=function(e,t,a){let n=t.trim().toLowerCase(),s={all:()=>!0,heard:e=>!ue(e),live:e=>e.live,charging:e=>null!==e.charging,silent:e=>!e.live,mission:e=>null!==e.mission,low:e=>null!==e.state_of_charge&&e.state_of_charge<.25}[a];return[...e.values()].filter(e=>s(e.state)&&(""===n||e.id.toLowerCase().includes(n)||(e.state.mission?.mission_id??"").toLowerCase().includes(n)))}(e.robots,t,a).sort((e,t)=>ue(e.state)-ue(t.state)||(n.down?-1:1)*o.sort(e,t)||ie.compare(e.id,t.id));s.current={key:l,at:r,rows:i}}return s.current.rows}(e,n,m&&!c?"heard":r,d),[b,v,w]=function(e){let t=R(null),[a,n]=E([0,40]);return D(()=>{let a=()=>{if(null===t.current)return;let a=t.current.getBoundingClientRect().top,s=Math.max(0,Math.floor(-a/46)-8),l=Math.min(e,Math.ceil((innerHeight-a)/46)+8);n(e=>e[0]===s&&e[1]===l?e:[s,l])};return a(),addEventListener("scroll",a,{passive:!0}),addEventListener("resize",a),()=>{removeEventListener("scroll",a),removeEventListener("resize",a)}},[e]),[t,Math.min(a[0],e),Math.min(Math.max(a[1],0),e)]}(p.length);return e.loaded||0!==e.robots.size?0===e.robots.size?ee`<h1>Fleet</h1><${g} title="No robot yet">A robot appears here when its telemetry arrives over LCM or its file is put to <code>/v1/robots/…</code>.<//>`:ee`
<h1 class="hidden">Fleet</h1>
<${pe} robots=${e.robots} />
<div class="tools">
<label class="find"><span class="hidden">Find a robot or mission</span><input type="search" placeholder="Find a robot or mission" value=${n} onInput=${e=>s(e.currentTarget.value)} /></label>
<${y} label="Show" value=${r} onChange=${o} options=${[["all","All"],["live","Live"],["silent","Silent"],["mission","On a mission"],["charging","Charging"],["low","Low charge"]]} />
<span class="key"><span class="swatch measured"></span>measured <span class="swatch modelled"></span>modelled</span>
</div>
<table class="grid fleet" aria-rowcount=${p.length+1}>
<thead><tr>${de.map(e=>ee`<th key=${e.key} scope="col" class=${e.class} aria-sort=${(e=>e.key!==d.key?void 0:d.down?"descending":"ascending")(e)}>
${e.sort?ee`<button type="button" onClick=${()=>(e=>u(t=>({key:e,down:t.key===e&&!t.down})))(e.key)}>${e.title}<span class="arrow" aria-hidden="true">${e.key===d.key?d.down?"▾":"▴":""}</span></button>`:e.title}</th>`)}</tr></thead>
<tbody ref=${b}>
${v>0&&ee`<tr key="above" aria-hidden="true" class="spacer"><td colspan=${de.length} style=${{height:46*v+"px"}}></td></tr>`}
${p.slice(v,w).map((e,n)=>ee`<${me} key=${e.id} entry=${e} revision=${e.revision} index=${v+n} dark=${t} band=${a.get(e.id)?.range} />`)}
${w<p.length&&ee`<tr key="below" aria-hidden="true" class="spacer"><td colspan=${de.length} style=${{height:46*(p.length-w)+"px"}}></td></tr>`}
</tbody>
</table>
${0===p.length&&ee`<${g} title="No robot matches" />`}
${m&&ee`<p class="fold"><button type="button" class="plain" aria-expanded=${String(c)} onClick=${()=>h(!c)}>${c?"Hide":"Show"} ${$} ${1===$?"robot":"robots"} not heard since the service started</button></p>`}`:null!==e.error?ee`<${_} error=${e.error} />`:ee`<${f} what="the fleet" />`},robots:function({id:e}){M(e);let s=l(),r=i(),o=se(e).get(e),d=n(`/v1/robots/${a(e)}`),u=n(`/v1/missions${t({robot_id:e,limit:12})}`),c=s.robots.get(e),$=c?.state,m=$?.mission?.id;return D(()=>{null!==u.value&&u.reload()},[m]),!$&&s.loaded&&404===d.error?.status?ee`<${g} title=${`There is no robot ${e}`}>See the <a href="#/fleet">fleet</a>.<//>`:ee`
<div class="heading"><p class="crumbs"><a href="#/fleet">Fleet</a></p><h1>${e}</h1>
${$&&ee`<span class="health"><${ce} state=${$} /></span>`}
<span class="spring"></span><a class="button" href=${`#/plan${t({robot:e})}`}>Plan a drive</a></div>
${$&&null===$.silent_s&&ee`<p class="note">Nothing was heard of it since the service started. What is kept of it stands below.</p>`}
${$&&null!==$.silent_s&&ee`<dl class="readouts">
<${p} large label=${null===$.measured_power_w?"Power (modelled)":"Power"} of=${U($.measured_power_w??$.modelled_power_w)} channel=${null===$.measured_power_w?"modelled":"measured"} note=${ee`<${ne} track=${c.power} revision=${c.revision} dark=${r} width=${120} height=${26} />`} />
<${p} large label="Charge" of=${H($.state_of_charge)} note=${[null===$.state_of_charge?"":he($).text,null===$.battery_voltage_v?"":V(q($.battery_voltage_v,"V",2))].filter(Boolean).join(" · ")} />
<${p} large label="Range" of=${G(o?.range?.p50??$.range_m)} note=${le(o?.range,G)} />
<${p} large label="Run time" of=${X(o?.time?.p50??$.run_time_s)} note=${le(o?.time,e=>({n:X(e),u:""}))} />
${null===$.charging&&F($.charge.time_to_charged_s)&&ee`<${p} large label="To charge" of=${X($.charge.time_to_charged_s)} note="if it went now" />`}
<${p} large label="Speed" of=${q($.speed_m_s,"m/s",2)} />
<${p} large label="Payload" of=${q($.payload_kg,"kg")} />
<${p} large label="Windings, right · left" of=${null===$.winding_temperature_c[0]?"–":`${W($.winding_temperature_c[0])} · ${W($.winding_temperature_c[1])} °C`} />
<${p} large label="Mission" of=${J($.mission?.energy.battery_j)} note=${$.mission?ee`<a href=${h($.mission.id)}>${$.mission.mission_id}</a>`:"none running"} />
</dl>`}
<${_e} part="RobotHistory" id=${e} />
<${v} title="Recent missions" aside=${ee`<a href=${`#/missions${t({robot:e})}`}>All missions of ${e}</a>`}><${b} of=${u} what="missions">${e=>0===e.missions.length?ee`<${g} title="No mission yet" />`:ee`<div class="scroll"><${De} missions=${e.missions} with_robot=${!1} /></div>`}<//><//>
<div class="columns">
<${v} class="screen" title="On the floor now">${c?ee`<${We} entry=${c} />`:ee`<${g} title="Never heard" />`}<//>
<${v} title="Model">${d.value?ee`<${Fe} model=${d.value.model} />`:ee`<p class="note">none</p>`}<//>
</div>`},missions:function({given:e}){M("Missions");let[a,s]=E(e),[l,r]=E([""]),o=R(JSON.stringify(e));D(()=>{JSON.stringify(e)!==o.current&&(o.current=JSON.stringify(e),s(e),r([""]))},[e]);let i=z(()=>Ee(a),[a]),d=l[l.length-1],u=n(`/v1/missions${t({...i,limit:50,cursor:d})}`),c=n(`/v1/mission-totals${t(i)}`);return ee`
<h1 class="hidden">Missions</h1>
<${Le} given=${a} change=${e=>{let t=Object.fromEntries(Object.entries(e).filter(([,e])=>""!==e));o.current=JSON.stringify(t),s(t),r([""]),$("missions",t)}} />
<${Re} told=${c} />
<div class="tools"><button type="button" onClick=${()=>{u.reload(),c.reload()}}>Refresh</button>
<span class="note">Times are local (${Intl.DateTimeFormat().resolvedOptions().timeZone})</span>
<${ze} given=${a} total=${c.value?.missions??0} /></div>
<${b} of=${u} what="missions">${({missions:e,next_cursor:t})=>ee`
${u.error&&ee`<${_} error=${u.error} retry=${u.reload} />`}
<div class=${u.loading?"stale":""} aria-busy=${String(u.loading)}>
${0===e.length?ee`<${g} title=${Object.keys(a).length>0?"No mission matches":"No mission yet"}>Missions appear when a robot announces one or sends telemetry.<//>`:ee`<div class="scroll"><${De} missions=${e} /></div>`}
</div>
<nav class="pages" aria-label="Pages of missions">
<button type="button" disabled=${1===l.length} onClick=${()=>r(l.slice(0,-1))}>Newer</button>
<span>${W(50*(l.length-1)+Math.min(1,e.length))} – ${W(50*(l.length-1)+e.length)}${c.value?` of ${W(c.value.missions)}`:""}</span>
<button type="button" disabled=${null===t} onClick=${()=>r([...l,t])}>Older</button>
</nav>`}<//>`},mission:function({id:e}){let s=n(`/v1/missions/${a(e)}`),l=null!==s.value,r=n(l?`/v1/missions/${a(e)}/ledger`:null),o=n(l?`/v1/missions/${a(e)}/trace${t({points:700})}`:null),i=null!==o.value&&o.value.start_utime_us.length>=350,d=n(i?`/v1/missions/${a(e)}/trace${t({points:6e3})}`:null),u=i?d.value:o.value;M(s.value?.mission_id??"Mission");let h="open"===s.value?.state;return D(()=>{if(!h)return;let e=setInterval(()=>[s,r,o].forEach(e=>e.reload()),3e3);return()=>clearInterval(e)},[h]),!l&&[400,404].includes(s.error?.status)?ee`<${g} title=${`There is no mission ${e}`}>No mission of this history has that number. See <a href="#/missions">all missions</a>.<//>`:ee`<${b} of=${s} what="the mission">${e=>{let t=e.energy,a=Oe(t);return ee`
<div class="heading"><p class="crumbs"><a href="#/missions">Missions</a> / <a href=${c(e.robot_id)}>${e.robot_id}</a></p>
<h1>${e.mission_id}</h1><${k} mission=${e} />
${e.incomplete&&ee`<span class="flag">incomplete${e.incomplete_reason?`: ${Q(e.incomplete_reason)}`:""}</span>`}
<span class="note">${Y(e.start_utime_us)}</span></div>
<dl class="readouts">
<${p} large label=${null===t.measured_j?"From the battery (modelled)":"From the battery"} of=${J(t.battery_j)} channel=${null===t.measured_j?"modelled":"measured"} />
<${p} large label="Modelled" of=${J(t.modelled_j)} channel="modelled" />
<${p} large label="Unexplained" of=${(()=>{let e=J(t.unexplained_j);return{n:I(e.n),u:e.u}})()} channel="gap" note=${null===a?"":`ratio ${W(a,3)}`} />
<${p} large label="Distance" of=${G(t.distance_m)} />
<${p} large label="Duration" of=${K(t.duration_s)} />
<${p} large label="Per metre" of=${q(t.distance_m>.1?t.battery_j/t.distance_m:null,"J/m")} />
<${p} large label="Payload" of=${q(e.payload_kg,"kg")} />
</dl>
<${b} of=${o} what="the trace">${t=>ee`<${Ve} mission=${e} whole=${t} fine=${u??t} />`}<//>
<div class="columns">
<${v} title="Where the energy went"><${b} of=${r} what="the ledger">${({ledger:e})=>ee`<${Je} terms_j=${e.terms_j} battery_j=${e.battery_j} closure=${e.closure_relative} />`}<//><//>
<div>
<${v} title="Against the minimum-energy drive">${null===e.model_version?ee`<${g} title="No model">The robot had no model on this mission.<//>`:h?ee`<${g} title="Still driving">Compared when the mission ends.<//>`:e.gap_s>0?ee`<${g} title="Not compared">For ${K(e.gap_s)} of the mission nothing is known.<//>`:u&&ee`<${Ke} mission=${e} trace=${u} />`}<//>
<${v} title="Record"><${Xe} mission=${e} /><//>
</div>
</div>`}}<//>`},plan:function({given:e}){M("Plan");let t=l(),n=[...t.robots.values()].filter(e=>e.state.has_model).map(e=>e.id).sort(),[s,r]=E(e.robot??""),[o,i]=E("legs"),[d,u]=E(lt),[c,h]=E([[-5,-2],[2,-2],[2,2.5],[5,2.5]]),[m,b]=E({payload:"",deadline:"",value:"",charge:""}),[w,k]=E({answer:null,error:null,busy:!1,autonomy:{value:null,error:null}}),x=R(null),j=n.includes(s)?s:n[0]??"",T=z(()=>"legs"===o?function(e){let[t,a,n]=[0,0,0],s=[[t,a]];for(let l of e)if("straight"===l.kind)t+=l.length*Math.cos(n),a+=l.length*Math.sin(n),s.push([t,a]);else if("turn"===l.kind)n+=l.angle*Ye;else if("arc"===l.kind){let e=l.angle<0?-1:1,r=Math.max(2,Math.ceil(Math.abs(l.angle)/5)),o=t-e*l.radius*Math.sin(n),i=a+e*l.radius*Math.cos(n);for(let t=1;t<=r;++t){let a=n+l.angle*Ye*t/r;s.push([o+e*l.radius*Math.sin(a),i-e*l.radius*Math.cos(a)])}n+=l.angle*Ye,[t,a]=s[s.length-1]}return s}(d).filter(([e,t])=>Number.isFinite(e+t)):c,[o,d,c]),C=z(()=>w.answer?.profile.x_m.map((e,t)=>[e,w.answer.profile.y_m[t],w.answer.profile.power_w[t]]),[w.answer]),N=async(e={})=>{let n={...m,...e},s=e=>""===e?void 0:Number(e);if("draw"===o&&c.length<2)return void k(e=>({...e,error:Object.assign(new Error("Draw at least two points."),{title:"No path yet"})}));x.current?.abort();let l=x.current=new AbortController;k(e=>({...e,busy:!0,error:null}));let r={..."draw"===o?tt(c):{path:d.map(et)},payload_kg:s(n.payload),deadline_s:s(n.deadline),value_of_time_w:s(n.value),pareto_points:24,baseline_columns:!0},i=s(n.charge),u=`/v1/robots/${a(j)}`,h=void 0!==i||null!==t.robots.get(j)?.state.state_of_charge?ae(`${u}/autonomy`,{state_of_charge:void 0===i?void 0:i/100,payload_kg:r.payload_kg},l.signal).then(e=>({value:e,error:null}),e=>({value:null,error:e})):{value:null,error:null};try{let e=await ae(`${u}/profile`,r,l.signal);k({answer:e,of:T,error:null,busy:!1,autonomy:await h})}catch(e){"AbortError"!==e.name&&k(t=>({...t,error:e,busy:!1}))}};if(D(()=>(""!==j&&N(),()=>x.current?.abort()),[j]),t.loaded&&0===n.length)return ee`<h1>Plan</h1><${g} title="No robot has a model">Put a robot file to <code>/v1/robots/…</code> to plan with it.<//>`;if(!t.loaded)return ee`<${f} what="the fleet" />`;let S=(e,t,a,n)=>ee`<label class="field"><span>${t}</span><span class="with-unit"><input type="number" step="any" min="0" value=${m[e]} onInput=${t=>b({...m,[e]:t.currentTarget.value})} ...${n} /><span class="unit">${a}</span></span></label>`,P=w.answer,O=/^\/path\/(\d+)/.exec(w.error?.field??""),A=P?.baselines;return ee`<h1 class="hidden">Plan</h1><div class="plan">
<form class="plan-form" onSubmit=${e=>{e.preventDefault(),N()}}>
<label class="field"><span>Robot</span><select value=${j} onChange=${e=>{r(e.currentTarget.value),$("plan",{robot:e.currentTarget.value})}}>${n.map(e=>ee`<option key=${e} value=${e}>${e}</option>`)}</select></label>
<${y} label="How to give the path" value=${o} onChange=${i} options=${[["legs","Enter legs"],["draw","Draw"]]} />
${"legs"===o?ee`<${rt} legs=${d} change=${u} fault=${O?Number(O[1]):null} />`:ee`<p class="note">${c.length} points, ${V(G(c.slice(1).reduce((e,[t,a],n)=>e+Math.hypot(t-c[n][0],a-c[n][1]),0)))}. Draw on the floor.</p>`}
<div class="terms">
${S("payload","Payload","kg",{placeholder:"0"})}
${S("deadline","Deadline","s",{placeholder:"free"})}
${S("value","Value of time","W",{placeholder:"0"})}
${S("charge","Charge now","%",{placeholder:"live",max:100})}
</div>
<button type="submit" class="primary" disabled=${""===j}>${w.busy?"Computing …":"Compute"}</button>
</form>
<div class="plan-result" aria-live="polite" aria-busy=${String(w.busy)}>
${w.error&&ee`<${_} error=${w.error} />`}
${"draw"===o&&ee`<${v} class="screen" title="Draw the path"><${st} points=${c} change=${h} /><//>`}
${null===P?null===w.error&&ee`<${f} what="the plan" />`:ee`<div class=${w.busy?"stale":""}>
<${mt} answer=${P} autonomy=${w.autonomy} />
<dl class="readouts">
<${p} large label="Least energy" of=${J(P.energy_j)} channel="accent" />
<${p} large label="Duration" of=${K(P.duration_s)} />
<${p} large label="Distance" of=${G(P.distance_m)} />
<${p} large label="Top speed" of=${q(P.peak_speed_m_s,"m/s",2)} />
<${p} large label="Per metre" of=${q(P.distance_m>0?P.energy_j/P.distance_m:null,"J/m")} />
</dl>
<div class="columns">
<div>
<${v} class="screen" title="Speed and power"><${it} answer=${P} /><//>
<${v} title="Against the usual profiles">
<${Be} label="Energy of the plan, a trapezoid and a triangle in the same time" rows=${[{name:"Least energy",value:P.energy_j,of:J(P.energy_j),channel:"least",note:""},...["trapezoid","triangle"].map(e=>({name:e[0].toUpperCase()+e.slice(1),value:A[e]?.energy_j??null,of:J(A[e]?.energy_j),channel:"plain",note:ht(A[e])}))]} />
<p class="note foot">All three in the same time on every run between stops.</p>
<//>
<${v} title="Where the energy goes"><${Je} terms_j=${P.ledger_j} battery_j=${P.energy_j} measured=${!1} /><//>
</div>
<div>
<${v} class="screen" title="On the floor"><${Te} points=${C} under=${w.of===T?null:T} height=${340} label="The planned path, coloured by power; circle: start, square: end" /><//>
<${v} class="screen" title="Energy against time">${P.pareto.length<2?ee`<${g} title="No front">Nothing to trade: time and energy do not compete on this path.<//>`:ee`<${dt} answer=${P} take=${({duration_s:e})=>{let t=String(Math.ceil(100*e)/100);b({...m,deadline:t}),N({deadline:t})}} />`}<//>
<${v} title="How sure the optimum is"><${$t} answer=${P} /><//>
</div>
</div></div>`}
${"legs"===o&&null===P&&T.length>1&&ee`<${v} class="screen" title="Path"><${Te} points=${T.map(([e,t])=>[e,t,NaN])} legend=${!1} label="The path that was entered" /><//>`}
</div></div>`},gap:e=>ee`<${_e} part="Gap" ...${e} />`};function gt(){let e=l(),t={live:"Live",connecting:"Connecting",offline:"Offline"}[e.link];return ee`<span class=${`link ${e.link}`} role="status"><span class="lamp" aria-hidden="true"></span>${t}</span>`}function ft(){let e=l(),[t,a]=E(!1);if(D(()=>{if(a(!1),"offline"!==e.link)return;let t=setTimeout(()=>a(!0),1500);return()=>clearTimeout(t)},[e.link]),!t)return null;let n=Z(1e3*e.since_ms);return ee`<div class="banner" role="alert">No connection to the service since ${n}. What is shown is as of then; trying again.</div>`}s(),S(ee`<${function(){let[e,t]=E(u(location.hash)),a=R(null),n=R(!0),s=i();D(()=>{let e=()=>t(u(location.hash));return addEventListener("hashchange",e),()=>removeEventListener("hashchange",e)},[]),D(()=>{n.current?n.current=!1:(scrollTo(0,0),a.current.focus({preventScroll:!0}))},[e.view,e.id]);let l=pt[e.view],r={robots:"fleet",mission:"missions"}[e.view]??e.view,d=(e,t)=>ee`<a href=${`#/${e}`} aria-current=${r===e?"page":void 0}>${t}</a>`;return ee`
<a class="skip" href="#main" onClick=${e=>{e.preventDefault(),a.current.focus()}}>Skip to content</a>
<header class="top">
<a class="mark" href="#/fleet" aria-label="joulecast, fleet">
<svg viewBox="0 0 32 20" width="38" height="24" aria-hidden="true"><path d="M1 14h6l4-12 6 17 4-10 2 5h8" /></svg>joulecast</a>
<nav aria-label="Views">${d("fleet","Fleet")}${d("missions","Missions")}${d("plan","Plan")}${d("gap","Gap")}</nav>
<${gt} />
<button type="button" class="theme" onClick=${o} aria-label=${s?"Light theme":"Dark theme"} title=${s?"Light theme":"Dark theme"}>
<svg viewBox="0 0 20 20" width="18" height="18" aria-hidden="true"><circle cx="10" cy="10" r="7.5" class="ring" /><path d="M10 2.5a7.5 7.5 0 0 1 0 15z" /></svg></button>
</header>
<${ft} />
<main id="main" tabindex="-1" ref=${a}>
<${x} view=${location.hash}>
${l?ee`<${l} key=${`${e.view}/${e.id??""}`} id=${e.id} given=${e.given} />`:ee`<${g} title="There is no such page">Go to the <a href="#/fleet">fleet</a>.<//>`}
<//>
</main>`}} />`,document.getElementById("app"));
