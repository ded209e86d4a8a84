// uPlot as it is published, in a file of its own that charts load when they are first drawn.
export { default } from 'uplot';
