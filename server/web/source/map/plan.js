// A level's plan: its image, and where it is on the canvas.
import { useEffect, useState } from 'preact/hooks';
import { idPath } from '../api.js';
import { isDark } from '../theme.js';

export const planPath = ({ map, level }) => `/v1/maps/${idPath(map)}/levels/${idPath(level)}`;

// The decoded image of the level; null until it is loaded, and without a plan. An SVG is an image here, too:
// its scripts do not run.
export function useImage(level) {
  const [image, setImage] = useState(null);
  const path = level && planPath(level);
  useEffect(() => {
    setImage(null);
    if (!path) return;
    const next = new Image();
    next.onload = () => setImage(next);
    next.src = path;
  }, [path, level?.changed_utime_us]);
  return image;
}

// Metres east and north of the lower left corner, turned about it.
function cornerOf(level, x, y) {
  const [cos, sin] = [Math.cos(level.origin_yaw_rad), Math.sin(level.origin_yaw_rad)];
  return [level.origin_x_m + cos * x - sin * y, level.origin_y_m + sin * x + cos * y];
}

export function cornersOf(level, image) {
  const [wide, tall] = [image.naturalWidth * level.resolution_m, image.naturalHeight * level.resolution_m];
  return [
    [0, 0],
    [wide, 0],
    [0, tall],
    [wide, tall],
  ].map(([x, y]) => cornerOf(level, x, y));
}

export function drawPlan(c, view, level, image) {
  const perPixel = view.scale * level.resolution_m;
  const [left, top] = view.to(...cornerOf(level, 0, image.naturalHeight * level.resolution_m));
  c.save();
  c.translate(left, top);
  c.rotate(-level.origin_yaw_rad);
  c.globalAlpha = 0.75;
  if (isDark()) c.filter = 'invert(1)';
  c.drawImage(image, 0, 0, image.naturalWidth * perPixel, image.naturalHeight * perPixel);
  c.restore();
}

// The fields of a map.yaml of ROS.
export function fromMapYaml(text) {
  const resolution = /^resolution:\s*([-+.\deE]+)/m.exec(text)?.[1];
  const origin =
    /^origin:\s*\[([^\]]+)\]/m
      .exec(text)?.[1]
      .split(',')
      .map((part) => part.trim()) ?? [];
  const found = {
    resolution_m: resolution,
    origin_x_m: origin[0],
    origin_y_m: origin[1],
    origin_yaw_rad: origin[2],
  };
  return Object.fromEntries(
    Object.entries(found).filter(([, value]) => Number.isFinite(Number(value ?? NaN))),
  );
}
