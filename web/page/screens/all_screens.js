// SPDX-License-Identifier: Apache-2.0
// The screens of the page by the name in their address. One with `nav` is in the menu.
import { showMonitor } from '../monitoring/monitor.js';
import { showMonitoringRecord } from '../monitoring/monitoring_record.js';
import { showRepeats } from '../set_up/repeats.js';
import { S } from '../words.js';
import { showAudit } from './audit.js';
import { showCheck } from './check.js';
import { showStatistics } from './patient/statistics.js';
import { showPatient, showPatients } from './patients.js';
import { showResult } from './result.js';
import { showScan } from './scan.js';
import { showSettings } from './settings.js';
import { showStatus } from './status.js';
import { showUpdate } from './update.js';
import { showUsers } from './users.js';

/// Loaded when it is opened for the first time, so that the first page is small. A browser does not
/// ask again for a module that it could not load.
const later = (load) => async (...given) => {
  const show = await load().catch(() => { throw new Error(S.noScreen); });
  return show(...given);
};
const showPlan = later(async () => (await import('./plan/plan.js')).showPlan);

export const kScreens = {
  status: { show: showStatus, permission: 'view', nav: true },
  patients: { show: showPatients, permission: 'view', nav: true },
  statistics: { show: showStatistics, permission: 'view', parent: 'patients' },
  patient: { show: showPatient, permission: 'view', parent: 'patients' },
  plan: { show: showPlan, permission: 'view', parent: 'patients' },
  scan: { show: showScan, permission: 'view', nav: true },
  result: { show: showResult, permission: 'view', nav: true },
  monitor: { show: showMonitor, permission: 'view', nav: true },
  monitoring: { show: showMonitoringRecord, permission: 'view', parent: 'monitor' },
  check: { show: showCheck, permission: 'view', nav: true },
  users: { show: showUsers, permission: 'login', nav: true },
  audit: { show: showAudit, permission: 'audit', nav: true },
  settings: { show: showSettings, permission: 'view', nav: true },
  repeats: { show: showRepeats, permission: 'view', parent: 'settings' },
  update: { show: showUpdate, permission: 'view', nav: true },
};
