// Colours of a value: viridis for heights (fit by M. Zucker, CC0), blue–grey–orange for deviations, grey for modulation.
// Each can be read without colour vision.
const STEPS = 256;
export const NOTHING = [38, 40, 46];

const RED = [0.27772733, 0.10509304, -0.33086183, -4.6342305, 6.22827, 4.776385, -5.435456];
const GREEN = [0.005407345, 1.4046135, 0.21484756, -5.799101, 14.179933, -13.745145, 4.6458526];
const BLUE = [0.3340998, 1.3845901, 0.09509516, -19.33244, 56.690552, -65.35303, 26.312435];

function viridis(share) {
  return [RED, GREEN, BLUE].map((channel) => {
    const value = channel.reduceRight((sum, factor) => sum * share + factor, 0);
    return Math.round(255 * Math.min(1, Math.max(0, value)));
  });
}

function diverging(share) {
  const ends = share < 0.5 ? [[30, 110, 230], [222, 224, 226]] : [[222, 224, 226], [232, 110, 10]];
  const part = share < 0.5 ? 2 * share : 2 * share - 1;
  return ends[0].map((from, at) => Math.round(from + part * (ends[1][at] - from)));
}

function grey(share) {
  const light = Math.round(30 + 225 * share);
  return [light, light, light];
}

function table(colour) {
  return Array.from({ length: STEPS }, (_, at) => colour(at / (STEPS - 1)));
}

const TABLES = { height: table(viridis), deviation: table(diverging), modulation: table(grey) };

export function colours(layer) { return TABLES[layer]; }

// Puts a map on a canvas of the map's size.
export function paint(canvas, map, layer) {
  const { width, height, scale } = map.about;
  canvas.width = width;
  canvas.height = height;
  const context = canvas.getContext("2d");
  const image = context.createImageData(width, height);
  const palette = TABLES[layer];
  const span = scale[1] - scale[0] || 1;
  for (let at = 0; at < map.values.length; at += 1) {
    const value = map.values[at];
    const share = Math.min(1, Math.max(0, (value - scale[0]) / span));
    const colour = Number.isNaN(value) ? NOTHING : palette[Math.round(share * (STEPS - 1))];
    image.data.set(colour, 4 * at);
    image.data[4 * at + 3] = 255;
  }
  context.putImageData(image, 0, 0);
}
