// SPDX-License-Identifier: Apache-2.0
// Low vision and colour blindness: the page at 200 % zoom, and the maps under deuteranopia.
// sight_test.mjs NODE_MODULES SERVER OUT_FOLDER CHROMIUM
import { Harness } from './harness.mjs';

const [modules, server, folder, chromium] = process.argv.slice(2);
const h = await Harness.start({ modules, command: [server, 'FOLDER'], folder, chromium });
const { check, equal } = h;

const engineer = await h.person('engineer');
const anna = await h.person('anna');
const bob = await h.person('bob');
const clara = await h.person('clara');
// A window of 1280x800 at 200 %.
const near = await h.person('near', { width: 640, height: 400 }, { deviceScaleFactor: 2 });
const eye = await h.person('eye');  // an empty page, in which screenshots are unpacked

const ok = (...asked) => h.ok(...asked);
const sweep = (...commands) => h.sweepByApi(bob, ...commands);

await h.step('a patient with an approved reference and an open fraction', async () => {
  await h.firstStart(engineer);
  h.tell('checked');
  h.tell('swift');
  for (const [name, role] of [['anna', 'technician'], ['bob', 'physicist'],
    ['clara', 'physicist']]) {
    await h.addAccountByApi(engineer, name, role);
  }
  for (const [page, name] of [[anna, 'anna'], [bob, 'bob'], [clara, 'clara'], [near, 'anna']]) {
    await h.logIn(page, name);
  }
  const { id } = await ok(anna, 'patients', 'POST', { code: 'PX-0042', site: 'thorax' });
  await ok(anna, `patients/${id}/open`, 'POST', { purpose: 'reference', reason: '', replaces: '' });
  await sweep();
  const { draft_reference_id: draft } = await ok(anna, `patients/${id}`, 'GET');
  const { revision } = await ok(bob, `references/${draft}`, 'GET');
  await ok(bob, `references/${draft}/plan`, 'PUT', { revision, posture: 'HFS',
    region_m: [[0.5, 0.36], [0.72, 0.36], [0.72, 0.54], [0.5, 0.54]],
    isocentre_m: [0.6, 0.45, 0.08], couch_markers: false, shift_tolerance_mm: 3,
    rotation_tolerance_deg: 1 });
  const { digest, revision: planned } = await ok(clara, `references/${draft}`, 'GET');
  await ok(clara, `references/${draft}/approve`, 'POST',
    { revision: planned, digest, password: h.password });
  await ok(anna, `patients/${id}/open`, 'POST',
    { purpose: 'fraction', reason: '', replaces: (await ok(bob, 'status')).session.id });
  await h.acknowledge(anna, bob, clara, near);
});

/// What of the result is in view without scrolling: the window, and where verdict and values end.
const inView = (page) => page.evaluate(() => {
  window.scrollTo(0, 0);
  const { clientWidth, clientHeight, scrollWidth } = document.documentElement;
  const boxOf = (element) => element.getBoundingClientRect().toJSON();
  return { clientWidth, clientHeight, scrollWidth,
    word: boxOf(document.querySelector('.verdict .word')),
    values: [...document.querySelectorAll('.result .number .value')].map(boxOf) };
});

await h.step('at 200 % verdict and six numbers are in view, and nothing scrolls sideways',
  async () => {
  await near.goto(`${h.url}#/result`);
  for (const [verdict, commands] of [['move', ['moved z 8 HFS']], ['unsure', ['unsure']],
    ['in_tolerance', ['moved z 0 HFS', 'tolerated']], ['no_answer', ['stranger']]]) {
    const id = await sweep(...commands);
    await near.locator(`a[href^="/result?scan=${id}&"]`).first().waitFor({ state: 'attached' });
    await near.locator(`.verdict.${verdict}`).waitFor();
    for (const language of ['en', 'de']) {
      await near.evaluate((code) => {
        localStorage.setItem('plumb-language-anna', code);
        window.dispatchEvent(new Event('plumb-language'));
      }, language);
      await near.locator(`html[lang=${language}]`).waitFor();
      await near.locator(`.verdict.${verdict}`).waitFor();
      await h.picture(near, `result-200-${verdict}-${language}.png`, { fullPage: false });
      const { clientWidth, clientHeight, scrollWidth, word, values } = await inView(near);
      const where = `${verdict}, ${language}`;
      check(scrollWidth <= clientWidth, `${where}: ${scrollWidth} px of ${clientWidth}`);
      check(word.top >= 0 && word.bottom <= clientHeight, `${where}: the verdict is in view`);
      equal(values.length, verdict === 'no_answer' ? 0 : 6, `${where}: numbers`);
      for (const { left, right, bottom } of values) {
        check(left >= 0 && right <= clientWidth && bottom <= clientHeight,
          `${where}: a number from ${left} to ${right} px, down to ${bottom} of ${clientHeight}`);
      }
    }
  }
});

/// The pixels of a part of the window as the screen shows them, [r, g, b] each.
async function seen(page, clip) {
  const picture = await page.screenshot({ clip, type: 'png' });
  return eye.evaluate(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (one) => one.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const context = canvas.getContext('2d');
    context.drawImage(bitmap, 0, 0);
    const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
    return Array.from({ length: data.length / 4 }, (_, i) => [...data.slice(4 * i, 4 * i + 3)]);
  }, picture.toString('base64'));
}
/// CIE L*a*b* of an sRGB colour.
function labOf(rgb) {
  const [r, g, b] = rgb.map((value) => value / 255)
    .map((value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4));
  const f = (t) => (t > 0.008856 ? Math.cbrt(t) : 7.787 * t + 16 / 116);
  const x = f((0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.9505);
  const y = f(0.2126 * r + 0.7152 * g + 0.0722 * b);
  const z = f((0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.089);
  return [116 * y - 16, 500 * (x - y), 200 * (y - z)];
}
const distance = (one, other) =>
  Math.hypot(...labOf(one).map((value, i) => value - labOf(other)[i]));
const meanOf = (pixels) =>
  [0, 1, 2].map((k) => pixels.reduce((sum, pixel) => sum + pixel[k], 0) / pixels.length);
const lightness = (pixels) => pixels.map((pixel) => labOf(pixel)[0]).sort((a, b) => a - b);

/// Where the map shows a hole, and the region without one: squares of the window.
const placesOf = (page) => page.locator('canvas.map').evaluate((canvas) => {
  const kBlock = 16;
  const { width, height } = canvas;
  const { data } = canvas.getContext('2d').getImageData(0, 0, width, height);
  const at = (x, y) => [...data.slice(4 * (y * width + x), 4 * (y * width + x) + 3)];
  const isStripe = (pixel) => ['10,10,12', '255,255,255'].includes(pixel.join());
  const box = canvas.getBoundingClientRect();
  const places = {};
  for (let top = 0; top + kBlock <= height; top += kBlock) {
    for (let left = 0; left + kBlock <= width; left += kBlock) {
      const pixels = Array.from({ length: kBlock * kBlock },
        (_, i) => at(left + i % kBlock, top + Math.floor(i / kBlock)));
      const share = (is) => pixels.filter(is).length / pixels.length;
      // What lies outside of the region is dimmed.
      const kind = share(isStripe) > 0.7 ? 'hole'
        : share((pixel) => !isStripe(pixel) && Math.min(...pixel) > 180) > 0.95 ? 'measured' : '';
      const scale = box.width / width;
      (places[kind] ??= []).push({ x: box.x + left * scale, y: box.y + top * scale,
        width: kBlock * scale, height: kBlock * scale });
    }
  }
  return places;
});

await h.step('holes, and which way the body lies off: told apart with any eyes', async () => {
  await sweep('hole');
  await anna.goto(`${h.url}#/result`);
  await anna.locator('.verdict.no_answer').waitFor();
  const map = anna.locator('.map-row canvas.map');
  await map.waitFor();
  await map.scrollIntoViewIfNeeded();
  const { hole: holes, measured } = await placesOf(anna);
  check(holes?.length > 3 && measured?.length > 3,
    `a hole in ${holes?.length} places, none in ${measured?.length}`);
  const scale = await anna.locator('.map-row .scale').boundingBox();
  const end = (share) => ({ x: scale.x + share * scale.width, y: scale.y + scale.height / 2 - 2,
    width: 4, height: 4 });
  const debug = await anna.context().newCDPSession(anna);
  for (const type of ['none', 'deuteranopia', 'protanopia', 'tritanopia', 'achromatopsia']) {
    await debug.send('Emulation.setEmulatedVisionDeficiency', { type });
    await h.picture(anna, `map-${type}.png`, { fullPage: false });
    const [hatched, plain] = [await seen(anna, holes[0]), await seen(anna, measured[0])];
    // Stripes from black to white; what was measured is even.
    const range = (pixels) => {
      const sorted = lightness(pixels);
      return sorted[Math.floor(0.9 * sorted.length)] - sorted[Math.floor(0.1 * sorted.length)];
    };
    check(range(hatched) > 60, `${type}: a hole is hatched, by ${range(hatched)}`);
    check(range(plain) < 20, `${type}: nothing else is, ${range(plain)}`);
    if (type === 'achromatopsia') continue;  // the scale's ends are equally dark
    const [low, high] = [meanOf(await seen(anna, end(0.25))), meanOf(await seen(anna, end(0.75)))];
    check(distance(low, high) > 30, `${type}: lower ${low} and higher ${high}`);
  }
});

await h.finish();
