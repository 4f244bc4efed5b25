// SPDX-License-Identifier: Apache-2.0
// Calibrates the room of a running plumbd, as its people do.
#pragma once

#include <gtest/gtest.h>

#include "tests/support/http_client.hpp"
#include "tests/support/plumbd.hpp"

namespace plumb::testing {

/// Scans the board three times, which the virtual sensor shows first, and signs the calibration.
inline void CalibrateRoom(Plumbd& plumbd, test::HttpClient& engineer, test::HttpClient& planner) {
  for (int i = 0; i < 3; ++i) {
    ASSERT_EQ(engineer.Post("/api/v1/checks/open").status, 200);
    plumbd.ScanOnce();
    ASSERT_EQ(plumbd.Sim("next-scene")["ok"], true);
  }
  const nlohmann::json candidate = planner.Get("/api/v1/room-calibration").json();
  ASSERT_EQ(candidate["why_not_sign"], "");
  ASSERT_EQ(planner
                .Post("/api/v1/room-calibration/sign",
                      {{"digest", candidate["digest"]}, {"password", test::kPassword}})
                .status,
            201);
}

}  // namespace plumb::testing
