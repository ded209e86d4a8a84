import '../shared.js';
export { Cluster } from './cluster.jsx';
export { Help } from './help.jsx';
export { RobotFile } from './robot_file.jsx';
