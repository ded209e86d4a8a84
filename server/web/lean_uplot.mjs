// Leaves out of uPlot what the page's charts do not use: its legend, its bars, steps and splines, scales other than
// linear ones, series joined from tables, and its words for dates. Each line must be found as it stands, so that
// another version of uPlot is looked at anew.
import { readFile } from 'node:fs/promises';

const cuts = [
  ['const FEAT_TIME          = true;', 'const FEAT_TIME = false;'],
  ['const showLegend = legend.show;', 'const showLegend = false;'],
  ['const getMultiVals = series[1] ? series[1].values : null;', 'const getMultiVals = null;'],
  ['multiValLegend = getMultiVals != null;', ''],
  ['const cursorFocus = focus.prox >= 0;', 'const cursorFocus = false;'],
  ['(paths.stepped = stepped);', ''],
  ['(paths.bars    = bars);', ''],
  ['(paths.spline  = monotoneCubic);', ''],
  ['uPlot.rangeLog = rangeLog;', ''],
  ['uPlot.rangeAsinh = rangeAsinh;', ''],
  ['uPlot.join = join;', ''],
  ['uPlot.fmtDate = fmtDate;', ''],
  ['uPlot.tzDate  = tzDate;', ''],
  ['const [ timeIncrsMs, _timeAxisStampsMs, timeAxisSplitsMs ] = genTimeStuffs(1);', 'const timeIncrsMs = null;'],
  ['const [ timeIncrsS,  _timeAxisStampsS,  timeAxisSplitsS  ] = genTimeStuffs(1e-3);', 'const timeIncrsS = null;'],
  ['const _timeAxisSplits = (ms == 1 ? timeAxisSplitsMs(_tzDate) : timeAxisSplitsS(_tzDate));', 'const _timeAxisSplits = null;'],
  ['const _timeAxisVals   = timeAxisVals(_tzDate, timeAxisStamps((ms == 1 ? _timeAxisStampsMs : _timeAxisStampsS), _fmtDate));', 'const _timeAxisVals = null;'],
  ['const _timeSeriesVal  = timeSeriesVal(_tzDate, timeSeriesStamp(_timeSeriesStamp, _fmtDate));', 'const _timeSeriesVal = null;'],
  ['let isTime = mode == 1 && scales[s.scale].time;', 'const isTime = false;'],
];
const everywhere = [
  [/(const|let) mode = \w+\.mode;/g, 'const mode = 1;', 3],
  [/if \(legend\.live\) \{/g, 'if (false) {', 2],
  [/let isTime = sc\.time;/g, 'const isTime = false;', 2],
  [/\b(\w+\.)?distr\s*(==\s*(3|4|100)|>= 3)(?!\d)/g, 'false', 15],
];

export const lean_uplot = {
  name: 'lean-uplot',
  setup: (b) => b.onLoad({ filter: /uPlot\.esm\.js$/ }, async ({ path }) => {
    let contents = await readFile(path, 'utf8');
    const stale = (what, found) => new Error(`uPlot has changed: ${found} times ${what}`);
    for (const [line, instead] of cuts) {
      const parts = contents.split(line);
      if (parts.length !== 2) throw stale(line, parts.length - 1);
      contents = parts.join(instead);
    }
    for (const [pattern, instead, least] of everywhere) {
      const found = contents.match(pattern)?.length ?? 0;
      if (found < least) throw stale(pattern, found);
      contents = contents.replace(pattern, instead);
    }
    return { contents, loader: 'js' };
  }),
};
