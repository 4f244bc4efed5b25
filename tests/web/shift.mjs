// SPDX-License-Identifier: Apache-2.0
// A unit in use: accounts of three roles, a patient whose reference is approved, and an open
// session.

export async function beginShift(h) {
  const { check } = h;
  const engineer = await h.person('engineer');
  const anna = await h.person('anna');
  const bob = await h.person('bob');
  const clara = await h.person('clara');
  const kPeople = [[anna, 'anna', 'technician'], [bob, 'bob', 'physicist'],
    [clara, 'clara', 'physicist']];

  async function addPatient(code) {
    await h.addPatient(anna, code);
    await anna.getByRole('heading', { name: code }).waitFor();
  }

  /// A sweep from the scan screen to its result.
  async function scan() {
    const before = (await h.api(anna, 'scans?limit=1')).body.scans[0]?.id;
    await anna.goto(`${h.url}#/scan`);
    await anna.getByRole('button', { name: /Start sweep|Scan again/ }).click();
    await anna.waitForURL(/#\/result/, { timeout: 60000 });
    await anna.locator('.verdict').waitFor();
    const newest = (await h.api(anna, 'scans?limit=1')).body.scans[0];
    check(newest.id !== before, 'a new scan');
    return newest;
  }

  await h.step('accounts of three roles, a patient, an approved reference', async () => {
    await h.firstStart(engineer);
    h.tell('checked');  // today, so that nothing is doubtful about a reference
    for (const [, name, role] of kPeople) await h.addAccountByApi(engineer, name, role);
    await Promise.all(kPeople.map(([page, name]) => h.logIn(page, name)));
    await addPatient('PX-0001');
    await anna.getByRole('button', { name: 'Scan a new reference' }).click();
    await scan();
    for (const page of [bob, clara]) {
      await page.goto(`${h.url}#/patients`);
      await page.getByRole('link', { name: 'PX-0001' }).click();
      await page.getByRole('link', { name: 'Plan, Version 1' }).click();
      if (page === bob) await page.getByRole('button', { name: 'Save plan' }).click();
      else {
        await page.getByRole('button', { name: 'Review and approve' }).click();
        await h.sign(page);
      }
      await page.getByText(page === bob ? 'Plan saved.' : 'approved by clara').waitFor();
    }
    await anna.goto(`${h.url}#/patients`);
    await anna.getByRole('link', { name: 'PX-0001' }).click();
    await anna.getByRole('button', { name: 'Start treatment session' }).click();
    await anna.locator('.who-line', { hasText: /PX-0001\s*Fraction/ }).waitFor();
  });
  return { engineer, anna, bob, clara, addPatient, scan };
}
