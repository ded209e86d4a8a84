// Modules that several of the parts loaded later use. Each part imports this file, so that shared modules
// make two files: those of the first load, and the others.
import './bars.jsx';
import './chart.jsx';
import './confirm.jsx';
import './floor.jsx';
import './models.js';
import './sign_in.jsx';
import './views/back_test.jsx';
import './views/changes.jsx';
import './views/choosing.jsx';
import './views/fleet.jsx';
import './views/floor_canvas.jsx';
import './views/jobs.jsx';
