// SPDX-License-Identifier: Apache-2.0
// What can be wrong with a screen that is drawn, found by measuring it in the browser; and which
// words a screen in another language must not show.

/// What differs between the page's texts of two languages: whole English texts, and the pieces of
/// those that are filled in. Words that are the same in the other language are left out.
export function englishTexts(en, es) {
  const ofPage = ({ texts }) =>
    Object.entries(texts).filter(([id]) => id.startsWith('page.')).map(([, text]) => text);
  const spanish = ofPage(es);
  const all = new Set(spanish);
  const texts = ofPage(en);
  const isTelling = (text) =>
    /[a-z]{2,} [a-z]{2,}/i.test(text) && !spanish.some((one) => one.includes(text));
  return {
    whole: texts.filter((text) => !text.includes('{') && /[a-z]{2}/i.test(text) && !all.has(text)),
    parts: texts.flatMap((text) => text.split(/[{}]/)).map((text) => text.trim()).filter(isTelling),
  };
}

/// Runs in the page. Returns what is wrong, each with its kind in front.
/// @param touched  Whether this is a phone.
/// @param tapped   Whether people tap here, with gloves perhaps.
/// @param wall     Whether this is the screen on the room's wall, which nobody scrolls.
/// @param english  What englishTexts() found, on a screen in another language; else null.
export function faultsOfLayout({ touched, tapped = touched, wall, english }) {
  const found = new Set();
  const shorten = (text) => text.trim().replace(/\s+/g, ' ').slice(0, 60);
  const nameOf = (element) =>
    `${element.tagName.toLowerCase()}${[...element.classList].map((one) => `.${one}`).join('')} `
      + `“${shorten(element.textContent || element.getAttribute('aria-label') || element.id)}”`;
  const add = (kind, element, more = '') => found.add(`${kind}: ${nameOf(element)}${more}`);
  const px = (value) => `${Math.round(value)} px`;
  window.scrollTo(0, 0);
  const { clientWidth, clientHeight, scrollWidth } = document.documentElement;
  if (scrollWidth > clientWidth) {
    found.add(`sideways: the document is ${scrollWidth - clientWidth} px too wide`);
  }

  // A modal dialog covers what is behind it; what floats for some seconds may do so, too.
  const scope = document.querySelector('dialog:modal') ?? document.body;
  // A page that cannot be scrolled must fit into the window as a whole.
  const neverScrolls = getComputedStyle(document.body).overflowY === 'hidden';
  const kUnseen = '.visually-hidden, .skip:not(:focus), .toast, noscript, script, style';
  const isShown = (element) =>
    element.checkVisibility({ visibilityProperty: true }) && !element.closest(kUnseen);
  const kControls = 'a[href], button, input:not([type=hidden]), select, textarea, summary';
  const controls = [...scope.querySelectorAll(kControls)].filter(isShown);
  const texts = [];
  for (const walker = document.createTreeWalker(scope, NodeFilter.SHOW_TEXT); walker.nextNode();) {
    const { currentNode: node } = walker;
    const owner = node.parentElement;
    if (!node.data.trim() || !isShown(owner)) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    const boxes =
      [...range.getClientRects()].filter(({ width, height }) => width > 0 && height > 0);
    if (boxes.length || owner.tagName === 'OPTION') {
      texts.push({ node, owner, boxes, text: shorten(node.data) });
    }
  }

  // Nothing lies out of view, and nothing is cut off by what it stands in.
  const kTolerance_px = 1.5;
  const styles = new Map();
  const styleOf = (element) =>
    styles.get(element) ?? styles.set(element, getComputedStyle(element)).get(element);
  const judge = (box, owner, text) => {
    const tell = (kind, by) =>
      found.add(`${kind}: ${nameOf(owner)}${text ? '' : ' (control)'}${by}`);
    if (box.right > clientWidth + kTolerance_px || box.left < -kTolerance_px) {
      tell('out of view', `, ${px(box.left)} to ${px(box.right)} of ${clientWidth}`);
    }
    if (neverScrolls && box.bottom > clientHeight + kTolerance_px) {
      tell('out of view', `, down to ${px(box.bottom)} of ${clientHeight}`);
    }
    for (let around = text ? owner : owner.parentElement; around && around !== document.body;
      around = around.parentElement) {
      const style = styleOf(around);
      const frame = around.getBoundingClientRect();
      const wide = Math.max(box.right - frame.right, frame.left - box.left);
      const tall = Math.max(box.bottom - frame.bottom, frame.top - box.top);
      // A line's box is higher than its letters.
      const slack = text ? 0.25 * box.height : kTolerance_px;
      if (style.overflowX !== 'visible' && wide > kTolerance_px) {
        tell('cut off', ` at the side, by ${px(wide)} of ${nameOf(around)}`);
      }
      if (['hidden', 'clip'].includes(style.overflowY) && tall > slack) {
        tell('cut off', ` above or below, by ${px(tall)} of ${nameOf(around)}`);
      }
      const painted = style.display !== 'inline'
        && (style.borderTopWidth !== '0px' || !/, 0\)$|transparent/.test(style.backgroundColor));
      if (painted && (wide > kTolerance_px || tall > slack)) {
        tell('sticks out', ` by ${px(Math.max(wide, tall))} of ${nameOf(around)}`);
      }
    }
  };
  for (const { owner, boxes } of texts) for (const box of boxes) judge(box, owner, true);
  for (const control of controls) judge(control.getBoundingClientRect(), control, false);

  // What is written in a field, or chosen in a list, fits into it.
  const ruler = document.createElement('canvas').getContext('2d');
  for (const control of controls.filter(({ tagName }) => ['INPUT', 'SELECT'].includes(tagName))) {
    const style = styleOf(control);
    const written = control.tagName === 'SELECT' ? control.selectedOptions[0]?.text ?? ''
      : ['checkbox', 'radio', 'range', 'file', 'password'].includes(control.type) ? ''
        : control.value || control.placeholder;
    ruler.font = style.font;
    ruler.letterSpacing = style.letterSpacing;
    const room = control.clientWidth - parseFloat(style.paddingLeft)
      - parseFloat(style.paddingRight) - (control.tagName === 'SELECT' ? 16 : 0);
    const needed = ruler.measureText(written).width;
    if (needed > room + kTolerance_px) {
      add('cut off', control, `: “${written}” needs ${px(needed)} of ${px(room)}`);
    }
  }

  // No two things lie on each other. The marks on a picture belong on it.
  const things = [
    ...texts.flatMap(({ owner, boxes }) => boxes.map((box) => ({ owner, box, isText: true }))),
    ...controls.map((owner) => ({ owner, box: owner.getBoundingClientRect(), isText: false })),
  ];
  things.forEach((a, i) => {
    for (const b of things.slice(i + 1)) {
      const wide = Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left);
      const tall = Math.min(a.box.bottom, b.box.bottom) - Math.max(a.box.top, b.box.top);
      if (wide < 2 || tall < 2 || a.owner === b.owner || a.owner.contains(b.owner)
        || b.owner.contains(a.owner)) {
        continue;
      }
      if (a.isText && b.isText && tall < 0.3 * Math.min(a.box.height, b.box.height)) continue;
      found.add(`overlap: ${nameOf(a.owner)} and ${nameOf(b.owner)}, ${px(wide)} by ${px(tall)}`);
    }
  });

  // What is read first on a phone is there without scrolling, below what forbids to act on it.
  const value = document.querySelector('.result .number .value');
  const end = value?.getBoundingClientRect().bottom ?? 0;
  if (touched && end > 0.65 * clientHeight) {
    add('far down', value, `: it ends at ${px(end)} of ${clientHeight}`);
  }
  const last = wall && [...document.querySelectorAll(
    '.screen:not(.is-old):has(.verdict:is(.move, .unsure)) .number')].at(-1);
  const below = last ? last.getBoundingClientRect().bottom : 0;
  if (below > clientHeight) add('far down', last, `: it ends at ${px(below)} of ${clientHeight}`);

  // For hands in gloves: 48 px, 60 px for what a screen is there for and what signs. A link in a
  // sentence is as high as WCAG 2.2 wants targets to be (2.5.8). A box is touched by its label,
  // too.
  const isInSentence = (link) => link.tagName === 'A' && styleOf(link).display.startsWith('inline')
    && [...link.parentElement.childNodes].some((one) => one !== link && one.textContent.trim())
    && !link.matches('.button, #top a');
  for (const control of tapped ? controls : []) {
    const { width, height } = (control.closest('label') ?? control).getBoundingClientRect();
    const inSentence = isInSentence(control);
    const least = inSentence ? 24 : control.matches('.primary, .signs') ? 60 : 48;
    if (height < least - 0.5 || (!inSentence && width < 47.5)) {
      add('small', control, `, ${px(width)} x ${px(height)} of ${least}`);
    }
  }

  // Every text is a text of the page's language: no key, no gap that was not filled, no English.
  const kInvisible = ['aria-label', 'alt', 'placeholder', 'title'];
  const said = [...texts.map(({ node, owner }) => [node.data, owner]),
    ...[...scope.querySelectorAll(kInvisible.map((one) => `[${one}]`).join())]
      .filter((one) => one.checkVisibility())
      .flatMap((one) => kInvisible.filter((name) => one.hasAttribute(name))
        .map((name) => [one.getAttribute(name), one]))];
  const whole = new Set(english?.whole);
  for (const [raw, owner] of said) {
    const text = raw.trim().replace(/\s+/g, ' ');
    if (/\{[\w:.+!]*\}|\$\{|\bundefined\b|\bNaN\b|\bnull\b|\bInfinity\b|\[object |=>/.test(text)) {
      add('raw', owner, `: ${shorten(text)}`);
    }
    const isQuoted = owner.closest('code, [lang=en], .bundle');
    if (!isQuoted && (/^[a-z]+(_[a-z]+)+$/.test(text) || /^[a-z]+[A-Z][A-Za-z]+$/.test(text))) {
      add('raw', owner, `: ${text}`);
    }
    if (!english || isQuoted) continue;
    if (whole.has(text) || english.parts.some((part) => text.includes(part))
      || /\b(the|of|and|is|are|were|with|this|not|by|for|from|to|it)\b/i.test(text)) {
      add('English', owner, `: ${shorten(text)}`);
    }
  }
  return [...found];
}
