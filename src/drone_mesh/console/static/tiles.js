// The map on which the mesh lies: tiles that Leaflet draws below the canvas and that follow its camera.
// Leaflet is loaded only if the console offers a map.

import { toEarth } from "./earth.js";

const TILE_PX = 256;
const EQUATOR_M = 6378137; // radius
const FLATTENING = 1 / 298.257;
const RAD = Math.PI / 180;
const DEEPEST_ZOOM = 26; // of the camera; deeper than the tiles, these are enlarged
const FARTHER_OUT = 2; // zooms above those of the tiles at which they are still drawn

const byId = (id) => document.getElementById(id);

/** The zoom of web tiles at which a metre at this latitude has `scale` pixels. */
function zoomFor(scale, latitude) {
  const sin2 = Math.sin(latitude * RAD) ** 2;
  // Tiles are drawn for a sphere: the mean of the earth's radii along the parallel and the meridian.
  const shape = 1 + FLATTENING * (2 * sin2 - 1);
  const metres = 2 * Math.PI * EQUATOR_M * shape * Math.cos(latitude * RAD);
  return Math.log2((scale * metres) / TILE_PX);
}

const NO_ORIGIN =
  "no map: the gateway does not know where it is; start it with --origin LAT,LON,ALT";

export class Tiles {
  #library = null;
  #leaflet = null; // its map
  #loading = false;
  #shown = ""; // the camera that it shows

  /** `complain(text)` is called if the map cannot be drawn. */
  constructor(mesh, camera, complain) {
    this.mesh = mesh;
    this.camera = camera;
    this.complain = complain;
    byId("show-map").addEventListener("change", () => this.follow());
  }

  /** Draws the map for the camera as it is now. */
  follow() {
    const { map, origin, clock } = this.mesh;
    const offered = Boolean(map && origin);
    document.body.toggleAttribute("data-on-map", offered);
    const wanted = offered && byId("show-map").checked;
    byId("tiles").hidden = !wanted;
    const misses = map && !origin && clock.t !== undefined; // only a gateway may have none
    const line = misses ? NO_ORIGIN : (wanted && map.credit) || "";
    byId("map-credit").hidden = !line;
    if (byId("map-credit").textContent !== line) byId("map-credit").textContent = line;
    if (!wanted) return;
    if (this.#leaflet) this.#move(origin);
    else this.#load(map);
  }

  async #load(offer) {
    if (this.#loading) return;
    this.#loading = true;
    const style = Object.assign(document.createElement("link"), {
      rel: "stylesheet",
      href: "/leaflet/leaflet.css",
    });
    document.head.append(style);
    try {
      this.#library = await import("/leaflet/leaflet-src.esm.js");
      this.#begin(this.#library, offer);
      this.follow();
    } catch (error) {
      this.complain(`no map: ${error.message}`);
    }
  }

  #begin(library, { url, min_zoom: low, max_zoom: high, bounds }) {
    this.#leaflet = library.map(byId("tiles"), {
      attributionControl: false, // the page names the author itself, as text
      boxZoom: false,
      doubleClickZoom: false,
      dragging: false,
      fadeAnimation: false,
      keyboard: false,
      scrollWheelZoom: false,
      touchZoom: false,
      trackResize: false,
      zoomAnimation: false,
      zoomControl: false,
      zoomSnap: 0,
    });
    const [west, south, east, north] = bounds;
    library
      .tileLayer(url, {
        ...(bounds.length && {
          bounds: [
            [south, west],
            [north, east],
          ],
        }),
        minZoom: Math.max(0, low - FARTHER_OUT),
        maxZoom: DEEPEST_ZOOM,
        minNativeZoom: low,
        maxNativeZoom: high,
        referrerPolicy: "origin", // servers want to know who asks
      })
      .addTo(this.#leaflet);
  }

  #move(origin) {
    const { x, y, scale, width, height } = this.camera;
    const shown = [x, y, scale, width, height, ...origin].join();
    if (shown === this.#shown) return;
    const first = !this.#shown;
    this.#shown = shown;
    const middle = this.#library.latLng(toEarth(origin, x, y));
    const zoom = zoomFor(scale, middle.lat);
    this.#leaflet.invalidateSize({ pan: false });
    if (first) this.#leaflet.setView(middle, zoom, { animate: false });
    // As its own pinch does: setView would drop all tiles and draw them anew.
    this.#leaflet._move(middle, zoom);
    this.#leaflet.fire("zoom");
  }
}
