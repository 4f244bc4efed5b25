// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "web/exchange/json.hpp"

namespace plumb::web {
namespace {

/// An object with objects inside each other, `depth` of them in all.
std::string Nested(int depth) {
  std::string text = "{}";
  for (int level = 1; level < depth; ++level) text = R"({"a":)" + text + "}";
  return text;
}

TEST(FieldsTest, ABodyIsOneObjectOfAtMostEightLevels) {
  EXPECT_NO_THROW(Fields{Nested(8)});
  for (const std::string& body :
       {Nested(9), std::string("[]"), std::string("{} {}"), std::string("7"), std::string()})
    EXPECT_THROW(Fields{body}, DataError) << body;
}

}  // namespace
}  // namespace plumb::web
