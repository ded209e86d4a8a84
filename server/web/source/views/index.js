import 'uplot/dist/uPlot.min.css';
import './views.css';

export { Audit } from './audit.jsx';
export { Compare } from './compare.jsx';
export { Gap } from './gap.jsx';
export { Help } from './help.jsx';
export { Mission } from './mission.jsx';
export { Missions } from './missions.jsx';
export { Plan } from './plan.jsx';
export { Robot } from './robot.jsx';
export { Trends } from './trends.jsx';
