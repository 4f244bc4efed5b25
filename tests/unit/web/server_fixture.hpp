// SPDX-License-Identifier: Apache-2.0
// A server that is talked to on the wire.
#pragma once

#include <string>

#include "tests/unit/web/web_fixture.hpp"

namespace plumb::test {

class ServerTest : public WebTest {
 protected:
  int StatusOf(const std::string& bytes) {
    HttpConnection connection(port_);
    connection.Send(bytes);
    return connection.Read().status;
  }
  void ExpectAlive() { EXPECT_EQ(HttpClient(port_).Get("/health").status, 200); }
};

}  // namespace plumb::test
