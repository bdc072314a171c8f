// From metres to pixels and back. y points up in the world and down on the screen.

const MIN_SCALE = 0.05; // px per m: 10 km on 500 px
const MAX_SCALE = 400;
const MARGIN_PX = 32;
const LABELS_PX = 28; // at the right and lower edges, where the grid is labelled

export class Camera {
  constructor() {
    this.width = 1;
    this.height = 1;
    this.scale = 20; // px per m
    this.x = 0; // m, in the middle of the picture
    this.y = 0;
  }

  toScreen(x, y) {
    return [
      this.width / 2 + (x - this.x) * this.scale,
      this.height / 2 - (y - this.y) * this.scale,
    ];
  }

  toWorld(px, py) {
    return [
      this.x + (px - this.width / 2) / this.scale,
      this.y - (py - this.height / 2) / this.scale,
    ];
  }

  pan(dx, dy) {
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
  }

  /** Zooms so that the point under (px, py) stays there. */
  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const [x, y] = this.toWorld(px, py);
    this.scale = Math.min(MAX_SCALE, Math.max(MIN_SCALE, this.scale * factor));
    const [nx, ny] = this.toWorld(px, py);
    this.x += x - nx;
    this.y += y - ny;
  }

  /** Shows all these [x, y], at least a few metres across; `top` px are covered. */
  fit(points, top) {
    if (!points.length) return;
    const xs = points.map((p) => p[0]);
    const ys = points.map((p) => p[1]);
    const [left, right] = [Math.min(...xs), Math.max(...xs)];
    const [low, high] = [Math.min(...ys), Math.max(...ys)];
    const wide = Math.max(this.width - 2 * MARGIN_PX - LABELS_PX, 60) / Math.max(right - left, 3);
    const tall =
      Math.max(this.height - 2 * MARGIN_PX - top - LABELS_PX, 60) / Math.max(high - low, 3);
    this.scale = Math.min(MAX_SCALE, Math.max(MIN_SCALE, Math.min(wide, tall)));
    this.x = (left + right + LABELS_PX / this.scale) / 2;
    this.y = (low + high) / 2 + (top - LABELS_PX) / 2 / this.scale;
  }
}
