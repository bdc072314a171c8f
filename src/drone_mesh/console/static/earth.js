// Degrees (WGS84) of places in the common frame, as drone/geodesy.py defines it: x is east and y north
// in metres at the height of the origin, and straight up changes neither.

const A = 6378137; // m, half the axis through the equator
const E2 = 0.00669437999014; // the square of the eccentricity
const RAD = Math.PI / 180;
const STEPS = 3; // each divides the error by 1000

/** x, y, z of a place (radians; metres above the ellipsoid) from the middle of the earth. */
function fromMiddle(latitude, longitude, height) {
  const n = A / Math.sqrt(1 - E2 * Math.sin(latitude) ** 2);
  const out = (n + height) * Math.cos(latitude);
  return [
    out * Math.cos(longitude),
    out * Math.sin(longitude),
    (n * (1 - E2) + height) * Math.sin(latitude),
  ];
}

/** [x, y] in metres of a place in degrees; `origin` is [latitude, longitude, altitude]. */
export function toFrame(origin, latitude, longitude) {
  const [lat0, lon0] = [origin[0] * RAD, origin[1] * RAD];
  const here = fromMiddle(latitude * RAD, longitude * RAD, origin[2]);
  const middle = fromMiddle(lat0, lon0, origin[2]);
  const [dx, dy, dz] = here.map((value, axis) => value - middle[axis]);
  const out = Math.cos(lon0) * dx + Math.sin(lon0) * dy;
  return [Math.cos(lon0) * dy - Math.sin(lon0) * dx, Math.cos(lat0) * dz - Math.sin(lat0) * out];
}

/** [latitude, longitude] in degrees of the place (x, y). */
export function toEarth(origin, x, y) {
  const sin = Math.sin(origin[0] * RAD);
  const n = A / Math.sqrt(1 - E2 * sin ** 2);
  const m = (n * (1 - E2)) / (1 - E2 * sin ** 2); // radius of the meridian
  let [latitude, longitude] = [origin[0], origin[1]];
  for (let step = 0; step < STEPS; step++) {
    const [east, north] = toFrame(origin, latitude, longitude);
    latitude += (y - north) / (m + origin[2]) / RAD;
    longitude += (x - east) / (n + origin[2]) / Math.cos(latitude * RAD) / RAD;
  }
  return [latitude, longitude];
}

/** A place in words, in degrees and metres above sea level. */
export function inDegrees(origin, [x, y, z]) {
  const [latitude, longitude] = toEarth(origin, x, y);
  return `${latitude.toFixed(6)}°, ${longitude.toFixed(6)}°, ${(origin[2] + z).toFixed(1)} m`;
}
