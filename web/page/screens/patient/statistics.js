// SPDX-License-Identifier: Apache-2.0
// Set-up statistics: of one course, and of the courses of a site.
import { get } from '../../api.js';
import { card, clear, field, fixed, h, hint, row, select, table } from '../../dom.js';
import { trend } from '../../drawings/trend.js';
import { signed, withUnit } from '../../numbers.js';
import { S } from '../../words.js';

const digits = (unit) => (unit === '°' ? 2 : 1);
const told = (value, unit) => (
  value === null ? S.none : withUnit(fixed(value, digits(unit)), unit));
const cell = (...children) => h('td', { class: 'digits' }, ...children);
const axisName = ({ name }) => S.result.axes[name];

/// "−1.2 ± 0.8 mm": mean and standard deviation.
function meanWords({ mean, deviation }, unit) {
  if (mean === null) return S.none;
  const value = signed(mean, digits(unit));
  return withUnit(
    deviation === null ? value : `${value} ± ${fixed(deviation, digits(unit))}`, unit);
}

function factsOf(course) {
  const text = S.statistics;
  return [text.fractions(course.fractions), text.scansEach(
    fixed(course.scans / course.fractions, 1)),
  course.accepted > 0 && text.overrides(course.overrides, course.accepted),
  course.minutes === null ? null : text.minutes(fixed(course.minutes, 1))]
    .filter(Boolean).join(' · ');
}

const versionOf = ({ reference_version: version }) => (
  version === null ? S.none : S.result.version(version));

/// Of one patient against one reference; nothing before two fractions have an answer.
function ofReference(course) {
  const text = S.statistics;
  if (course.fractions < 2) return null;
  return [h('h3', {}, `${S.result.reference}: ${versionOf(course)}`), hint(factsOf(course)),
    table([text.number, text.first, text.last], course.numbers.map((number) => row(
      axisName(number), cell(meanWords(number.first, number.unit)),
      cell(meanWords(number.last, number.unit)))), text.title)];
}

/// Of one patient, with the trend over the fractions.
export function courseStatistics(courses, scans, tolerance) {
  const text = S.statistics;
  const tables = (courses ?? []).map(ofReference).filter(Boolean);
  if (!tables.length) return null;
  return card(text.title, tables, hint(text.courseHint), trend(scans, tolerance, true));
}

function siteTable(site, which) {
  const text = S.statistics;
  return table([text.number, text.courses, text.mean, text.systematic, text.random],
    site.numbers.map((number) => {
      const spread = number[which];
      const mean = meanWords({ mean: spread.mean, deviation: null }, number.unit);
      return row(axisName(number), spread.courses, cell(mean),
        cell(told(spread.systematic, number.unit)), cell(told(spread.random, number.unit)));
    }), text.ofSite(site.site || S.none));
}

function courseTable(courses, which) {
  const text = S.statistics;
  const axes = courses[0].numbers.map(axisName);
  const heads = [S.patients.code, text.fractionsHead, text.scansHead, text.overridesHead, ...axes];
  return table(heads,
    courses.map((course) => row(
      // Below the code, not in a column of its own: ten columns are as many as fit at 1280 px.
      h('td', {}, h('a', { href: `#/patient/${course.patient_id}` }, course.code), h('br'),
        h('small', {}, versionOf(course))), course.fractions, course.scans, course.overrides,
      ...course.numbers.map((number) => cell(meanWords(number[which], number.unit))))),
    text.ofCourses);
}

export async function showStatistics(place) {
  const text = S.statistics;
  const { courses, sites, left_out: leftOut } = await get('statistics');
  const body = h('div', {});
  const names = Object.fromEntries(sites.map(({ site }, i) => [`${i}`, site || text.noSite]));
  const site = select(names, '0');
  const which = select({ first: text.first, last: text.last }, 'first');
  const draw = () => {
    const chosen = sites[Number(site.value)];
    const same = (one) => one.site.toLowerCase() === chosen.site.toLowerCase();
    clear(body, siteTable(chosen, which.value), hint(text.siteHint),
      h('h2', {}, text.ofCourses), courseTable(courses.filter(same), which.value));
  };
  site.addEventListener('change', draw);
  which.addEventListener('change', draw);
  clear(place, h('h1', {}, text.title), h('section', { class: 'card' },
    sites.length ? [h('div', { class: 'form inline' }, field(S.patients.site, site),
      field(text.which, which)), body] : hint(text.empty),
    leftOut > 0 && h('p', { class: 'caution' }, text.leftOut(leftOut)),
    h('div', { class: 'row below' }, h('a', {
      class: 'button', download: '',
      href: `/api/v1/statistics.csv?language=${document.documentElement.lang}`,
    }, text.csv))));
  if (sites.length) draw();
}
