// SPDX-License-Identifier: Apache-2.0
// The page over TLS, and its certificate replaced on the page: certificate_test.mjs NODE_MODULES
// SERVER OUT_FOLDER CHROMIUM
import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { get as getByTls } from 'node:https';
import { connect } from 'node:tls';
import { Harness } from './harness.mjs';

const [modules, server, folder, chromium] = process.argv.slice(2);
const h = await Harness.start({ modules, command: [server, 'FOLDER', 'tls'], folder, chromium });
const { check, equal } = h;
const engineer = await h.person('engineer');
const card = engineer.locator('.certificate');

/// Of the certificate that a new connection is shown.
const shown = () => new Promise((found, failed) => {
  const socket = connect(
    { host: '127.0.0.1', port: Number(new URL(h.url).port), rejectUnauthorized: false }, () => {
    found(socket.getPeerCertificate().fingerprint256);
    socket.end();
  });
  socket.on('error', failed);
});

/// What anybody is sent from that path, who trusts only these authorities, or everybody.
const fetched = (path, ca) => new Promise((found, failed) => {
  getByTls({ host: 'localhost', family: 4, port: new URL(h.url).port, path, agent: false,
    ...(ca ? { ca } : { rejectUnauthorized: false }) }, (response) => {
    let body = '';
    response.on('data', (part) => { body += part; });
    response.on('end', () => found({ status: response.statusCode, body,
      type: response.headers['content-type'] }));
  }).on('error', failed);
});

function madeCertificate(name) {
  const files = { chain: h.file(`${name}.pem`), key: h.file(`${name}.key`) };
  execFileSync('openssl', ['req', '-x509', '-newkey', 'ec', '-pkeyopt',
    'ec_paramgen_curve:prime256v1', '-nodes', '-days', '90', '-subj', `/CN=${name}`, '-keyout',
    files.key, '-out', files.chain], { stdio: 'ignore' });
  return files;
}

const madeCertificateText = () => readFileSync(madeCertificate('another').chain, 'utf8');

async function replace(password) {
  await card.getByLabel('Your password').fill(password);
  await card.getByRole('button', { name: 'Replace the certificate' }).click();
}

const first = await shown();

await h.step('the card names the certificate that a browser is shown', async () => {
  await h.firstStart(engineer);
  equal(new URL(engineer.url()).protocol, 'https:', 'the page is served over TLS');
  await engineer.goto(`${h.url}#/settings`);
  await card.getByText(first).waitFor();
});

await h.step('a wrong password changes nothing', async () => {
  await card.getByLabel('What to do').selectOption('own');
  await replace('wrong horse battery');
  await engineer.getByRole('alert').getByText('the password is wrong').waitFor();
  equal(await shown(), first, 'the certificate');
});

let authority = '';
await h.step('without a log-in, the certificate of the unit’s own authority, and how to install it',
  async () => {
  const { status, body, type } = await fetched('/authority.crt');
  equal(status, 200, 'for anybody');
  equal(type, 'application/x-x509-ca-cert', 'as what devices install');
  authority = body;
  check(!/PRIVATE/.test(authority), 'no key');
  equal((await fetched('/health', authority)).status, 200, 'who trusts it trusts the page');
  check(/self.signed|unable to (get|verify)/i.test(await fetched('/health', madeCertificateText())
    .then(() => '', (error) => error.message)), 'who trusts another one does not');
  const how = card.locator('details.authority');
  await how.getByText('This unit’s own authority').click();
  equal(await how.locator('li').count(), 4, 'four kinds of devices');
  await how.getByText(`open ${h.url}authority.crt in Safari`).waitFor();
  equal(await how.getByRole('link', { name: 'Certificate of the authority' }).getAttribute('href'),
    `${h.url}authority.crt`, 'the link');
  await h.look(engineer, 'authority');
});

let second = '';
await h.step('a new one of the unit’s own is used for new connections at once', async () => {
  await replace(h.password);
  await card.getByText(first).waitFor({ state: 'detached' });
  second = await card.locator('code').first().textContent();
  check(second !== first, 'another fingerprint');
  equal(await shown(), second, 'what a new connection is shown');
  equal((await fetched('/health', authority)).status, 200, 'those who trust it are not asked');
  equal((await fetched('/authority.crt', authority)).body, authority, 'the same authority');
});

await h.step('a key that does not belong to the certificate is refused with the reason',
  async () => {
  const [one, other] = [madeCertificate('one'), madeCertificate('other')];
  await card.getByLabel('What to do').selectOption('given');
  await card.getByLabel('Certificate, followed by').setInputFiles(one.chain);
  await card.getByLabel('Private key').setInputFiles(other.key);
  await replace(h.password);
  await engineer.getByRole('alert').getByText(/key/).waitFor();
  equal(await shown(), second, 'the certificate');
  await h.look(engineer, 'certificate-refused');
});

await h.step('a certificate of one’s own, sent with the line ends of another system', async () => {
  const own = madeCertificate('plumb-room-2');
  const file = (name, path) => ({ name, mimeType: 'text/plain',
    buffer: Buffer.from(readFileSync(path, 'utf8').replaceAll('\n', '\r\n')) });
  await card.getByLabel('Certificate, followed by').setInputFiles(file('room.pem', own.chain));
  await card.getByLabel('Private key').setInputFiles(file('room.key', own.key));
  await replace(h.password);
  await card.getByText(/Issued to: .*plumb-room-2/).waitFor();
  const third = await card.locator('code').first().textContent();
  equal(await shown(), third, 'what a new connection is shown');
  check(third !== second, 'another fingerprint');
  await h.look(engineer, 'certificate-replaced', { axe: false });
  equal(await card.locator('details.authority').count(), 0, 'no authority of the unit signs it');
  equal((await fetched('/authority.crt')).status, 404, 'nothing to install');
  await engineer.goto(`${h.url}#/audit`);
  for (const fingerprint of [first, second, third]) {
    await engineer.getByText(new RegExp(fingerprint)).first().waitFor();
  }
});

await h.finish();
