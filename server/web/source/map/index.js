import '../shared.js';
export { FloorLive } from './map.jsx';
