// SPDX-License-Identifier: Apache-2.0
// Limits of the values in forms. The server checks them again; a test compares these with its own
// limits (web/model/limits.hpp).

export const kBounds = {
  shift_tolerance_mm: { min: 0.1, max: 50, step: 0.1 },
  rotation_tolerance_deg: { min: 0.1, max: 20, step: 0.1 },
  clothing_mm: { min: 0, max: 30, step: 'any' },
  ct_breathing_mm: { min: 0, max: 30, step: 'any' },
  auto_stop_s: { min: 1, max: 120, step: 1 },
  scan_limit_s: { min: 5, max: 600, step: 1 },
  retention_days: { min: 0, max: 36500, step: 1 },
  idle_logout_min: { min: 1, max: 240, step: 1 },
  breath_window_mm: { min: 1, max: 20, step: 0.5 },
};
export const kFraction = { min: 1, max: 999, step: 1 };

/// Of the skin in CT images, in HU; `value` is where a person begins.
export const kThreshold = { min: -900, max: 0, value: -300 };

/// For how long a result is shown as one to act on (web/model/scan.hpp).
export const kResult = { valid_s: 120 };

/// Where no plan states one (algo/verdict/default_tolerance.hpp).
export const kTolerance = { shift_mm: 3, rotation_deg: 1 };

/// Of a drawing on the set-up sheet.
export const kDrawing = { points: 3000 };

export const kName = { maxlength: 32 };
export const kSite = { maxlength: 64 };
export const kNote = { maxlength: 500 };
export const kReason = { minlength: 3, maxlength: 200 };
export const kPassword = { maxlength: 128 };
export const kNewPassword = { minlength: 10, maxlength: 128 };
