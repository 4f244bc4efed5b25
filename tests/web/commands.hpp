// SPDX-License-Identifier: Apache-2.0
// The lines that plumb_web_test_server obeys.
#pragma once

#include <string>

#include "tests/support/fake_appliance.hpp"
#include "tests/web/recorder.hpp"

namespace plumb::test {

/// test_server.cpp lists them. A line that is not known does nothing.
void Obey(FakeAppliance& service, Recorder& recorder, const std::string& command);

}  // namespace plumb::test
