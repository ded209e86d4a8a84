import '../shared.js';
export { Audit } from './audit.jsx';
export { Floor } from './floor_map.jsx';
export { Mission } from './mission.jsx';
export { Missions } from './missions.jsx';
export { Plan } from './plan.jsx';
export { Robot } from './robot.jsx';
export { Trends } from './trends.jsx';
