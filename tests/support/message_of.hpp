// SPDX-License-Identifier: Apache-2.0
// Messages of expected exceptions: EXPECT_THAT(MessageOf<DataError>(call), HasSubstr("what a person
// needs to see")).
#pragma once

#include <gmock/gmock.h>

#include <string>

#include "algo/base/errors.hpp"

namespace plumb::testing {

/// Runs `call` and returns the message of the `Error` it throws; a failure of the test if it throws
/// nothing or another kind.
template <typename Error, typename Call>
std::string MessageOf(Call&& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  } catch (const std::exception& error) {
    ADD_FAILURE() << "another kind of exception: " << error.what();
    return {};
  }
  ADD_FAILURE() << "no exception";
  return {};
}

}  // namespace plumb::testing
