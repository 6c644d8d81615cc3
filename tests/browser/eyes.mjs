// Colours as colour-blind eyes see them: Machado, Oliveira and Fernandes, IEEE TVCG 15 (2009), severity 1.0; distances in
// CIE L*a*b* (1976).

const EYES = {
  "three cones": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
  protanopia: [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
  deuteranopia: [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
  tritanopia: [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.3039]],
};
/** Rows x, y, z of sRGB's primaries, and its white. */
const XYZ = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];
const WHITE = [0.9505, 1, 1.089];
/** Two that are that far apart are told from each other at a glance; a hair that is seen is 2.3. */
const APART = 20;
/** What WCAG 2.2 asks of graphics (1.4.11). */
const CONTRAST = 3;

const times = (matrix, vector) => matrix.map((row) => row.reduce((sum, value, i) => sum + value * vector[i], 0));
const linear = (rgb) => rgb.map((value) => value / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
const luminance = (rgb) => times(XYZ, linear(rgb))[1];

function lab(light) {
  const [x, y, z] = times(XYZ, light).map((value, i) => value / WHITE[i]).map((t) => (t > 216 / 24389 ? Math.cbrt(t) : ((24389 / 27) * t + 16) / 116));
  return [116 * y - 16, 500 * (x - y), 200 * (y - z)];
}

/** What is wrong with lines of these colours {name: [r, g, b]} on a floor. */
export function unlike(lines, floor) {
  const troubles = [];
  const names = Object.keys(lines);
  for (const [eyes, matrix] of Object.entries(EYES)) {
    const seen = names.map((name) => lab(times(matrix, linear(lines[name])).map((value) => Math.min(1, Math.max(0, value)))));
    names.forEach((name, i) => names.slice(0, i).forEach((other, j) => {
      const distance = Math.hypot(...seen[i].map((value, k) => value - seen[j][k]));
      if (distance < APART) troubles.push(`${name} and ${other} are ${distance.toFixed(1)} apart with ${eyes}, ${APART} are wanted`);
    }));
  }
  for (const name of names) {
    const [dark, bright] = [luminance(lines[name]), luminance(floor)].sort((a, b) => a - b);
    const contrast = (bright + 0.05) / (dark + 0.05);
    if (contrast < CONTRAST) troubles.push(`${name} has a contrast of ${contrast.toFixed(1)} to the floor, ${CONTRAST} is wanted`);
  }
  return troubles;
}
