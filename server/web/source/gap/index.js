import '../shared.js';
export { Gap } from '../views/gap.jsx';
