// SPDX-License-Identifier: Apache-2.0
// The audit log in people's words. What is stored, identifiers and English, is covered by the log's
// chain and never changes; only here is it worded. What is not known stays as it is stored.
import { localTime } from './dom.js';
import { S, said, wordOf } from './words.js';

/// The appliance itself, which has no address; what it gives as a reason is one of its words, not a
/// person's text.
const kSelf = 'plumbd';

const plain = (value) => (value === true ? S.audit.yes : value === false ? S.audit.no
  : `${value}`.replace('.', S.decimal));

function planWords(plan) {
  const text = S.plan;
  const point = plan.isocentre_m?.map((value) => plain(Number(value.toFixed(3)))).join('; ');
  return [text.corners(plan.region_m.length),
    `${text.isocentre}: ${point ? `${point} m` : text.middle}`,
    `±${plain(plan.shift_tolerance_mm)} mm, ±${plain(plan.rotation_tolerance_deg)}°`,
    wordOf(text.postures, plan.posture),
    plan.couch_markers ? text.couchMarkers : text.roomMarkers,
    ...[['clothing', plan.clothing_mm], ['ctBreathing', plan.ct_breathing_mm]]
      .filter(([, value]) => value)
      .map(([name, value]) => `${text[name]}: ±${plain(value)}`)].join('; ');
}

/// The plan before and after, a line each; earlier versions wrote only the new one.
function planChange(detail) {
  const [before, after] = detail.split('\n').map((plan) => planWords(JSON.parse(plan)));
  return after === undefined || before === after ? before : `${before} → ${after}`;
}

/// Each setting that was changed, before and after.
const settingsWords = (changes) => Object.entries(changes).map(([name, values]) => {
  const words = {
    posture: S.plan.postures, accept_live: S.settings.acceptLiveBy, paper: S.settings.papers,
  }[name];
  const told = (value) => (words ? wordOf(words, value) : plain(value));
  return `${wordOf(S.settings, name)}: ${[values].flat().map(told).join(' → ')}`;
}).join('; ');

/// Each key of the configuration that was changed, before and after; "restart" follows where the
/// new value is in use only after one.
const configWords = (changes) => Object.entries(changes).map(([key, [before, after, later]]) =>
  `${key}: ${[before, after].map((value) => value ?? S.audit.byDefault).join(' → ')}`
    + (later ? ` (${S.audit.fromNextStart})` : '')).join('; ');

/// "move, vertical +1.20 mm, pitch -0.10 deg; reason: swelling"; the reason is a person's text.
function acceptWords(detail) {
  const [, result, reason] = /^([^;]*)(?:; reason: ([^]*))?$/.exec(detail) ?? [];
  const [verdict, ...numbers] = result?.split(', ') ?? [];
  if (!Object.hasOwn(S.result.verdicts, verdict ?? '')) return detail;
  const words = numbers.map((number) => {
    const [, axis, value, unit] = /^(\w+) ([+-][\d.]+) (mm|deg)$/.exec(number) ?? [];
    if (!axis) return number;
    const signed = value.replace('-', '−').replace('.', S.decimal);
    return `${wordOf(S.result.axes, axis)} ${signed}${unit === 'mm' ? ' mm' : '°'}`;
  });
  return [S.result.verdicts[verdict], ...words].join(', ')
    + (reason === undefined ? '' : `; ${S.audit.reason(reason)}`);
}

/// "role technician > engineer password disabled": any of the three. Earlier versions wrote only
/// the new role.
function accountWords(detail) {
  const found = /^(?:role (\w+(?: > \w+)?) ?)?((?:(?:password|disabled|enabled) ?)*)$/.exec(detail);
  if (!detail || !found) return detail;
  const [, roles, others] = found;
  const role = roles?.split(' > ').map((one) => wordOf(S.roles, one)).join(' → ');
  return [role && S.audit.role(role),
    ...others.split(' ').filter(Boolean).map((one) => S.audit.changes[one])]
    .filter(Boolean).join(', ');
}

const scanKind = (detail) =>
  (detail === 'unassigned' ? S.audit.unassigned : wordOf(S.purposes, detail));
const kDetails = {
  'session.open': (detail) => wordOf(S.purposes, detail),
  'session.fraction': (detail) => {
    const [, before, after, reason] = /^from (\d+) to (\d+); reason: ([^]*)$/.exec(detail) ?? [];
    return before ? `${S.audit.correction(before, after)}; ${S.audit.reason(reason)}` : detail;
  },
  'session.reference': (detail) => {
    const [, version] = /^version (\d+)$/.exec(detail) ?? [];
    return version ? S.result.version(Number(version)) : detail;
  },
  'scan.start': scanKind,
  'scan.end': scanKind,
  cancel: scanKind,
  press: (detail) => wordOf(S.states, detail),
  'check.done': (detail) => wordOf(S.check.verdicts, detail),
  'scan.accept': acceptWords,
  'scan.accept_outside': acceptWords,
  'scan.remove': (detail, bySelf) => (bySelf ? wordOf(S.audit.removals, detail) : detail),
  'recording.remove': (detail) => wordOf(S.audit.removals, detail),
  'template.remove': (detail) => detail,  // the site, as a person named it
  'user.add': (detail) => wordOf(S.roles, detail),
  'user.change': accountWords,
  'reference.plan': planChange,
  'settings.change': (detail) => settingsWords(JSON.parse(detail)),
  'config.reload': (detail) => configWords(JSON.parse(detail)),
};

/// The words of an entry beside its action.
export function detailWords(entry) {
  const { action, user, address, detail } = entry;
  if (entry.detail_message || !Object.hasOwn(kDetails, action)) return said(entry, 'detail');
  try {
    return kDetails[action](detail, user === kSelf && !address);
  } catch {
    return detail;  // not in the form that this version writes
  }
}

/// Who did it. The appliance's button and its control socket have no address, unlike an account of
/// that name.
export const userWords = ({ user, address }) => (address ? user : wordOf(S.audit.users, user));

/// The subject of an entry as people know it: a code and a number instead of a row of the database.
export function subjectWords({ subject, about }) {
  if (!about) return subject;
  const text = S.audit.about;
  if (!about.exists) return text.gone(wordOf(text.kinds, about.kind), subject);
  const words = {
    patient: () => '',
    session: () => (about.number ? S.session.fraction(about.number) : S.purposes.reference),
    scan: () => text.scan(subject),
    reference: () => text.reference(about.number),
    check: () => text.check(localTime(about.time)),
  }[about.kind]?.() ?? subject;
  return [about.patient_code, words].filter(Boolean).join(', ');
}
