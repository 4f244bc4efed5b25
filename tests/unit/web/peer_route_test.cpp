// SPDX-License-Identifier: Apache-2.0
// What other units may ask, and what they learn.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/web/web_fixture.hpp"
#include "web/security/patient_hash.hpp"

namespace plumb::web {
namespace {

class PeerRoute : public test::WebTest {
 protected:
  test::HttpAnswer Ask(const std::string& patient, const std::string& secret) {
    test::HttpClient client(port_);
    client.extra_headers = {{"Authorization", "Bearer " + secret}};
    return client.Get("/peers/open" + (patient.empty() ? "" : "?patient=" + patient));
  }
  const std::string secret_ = std::string(40, 's');
};

TEST_F(PeerRoute, SaysToOtherUnitsWhetherThatPatientIsOpen) {
  Start([&](HttpServerOptions& options) { options.peer_secret = secret_; });
  const std::string hash = PatientHash("p7", secret_);
  EXPECT_EQ(Ask(hash, secret_).json(), (nlohmann::json{{"open", false}})) << "nobody is";
  loop_->Do([&] {
    TreatmentSession session;
    session.id = "3";
    session.patient_code = "P-7";
    service_.status.session = session;
  });
  EXPECT_EQ(Ask(hash, secret_).json(), (nlohmann::json{{"open", true}}));
  EXPECT_EQ(Ask(PatientHash("P-70", secret_), secret_).json()["open"], false);
  EXPECT_EQ(Ask(PatientHash("p-7", secret_ + "x"), secret_).json()["open"], false);
  EXPECT_EQ(Ask("p-7", secret_).json()["open"], false);
  EXPECT_EQ(Ask("", secret_).json()["open"], false);
  for (const std::string& wrong : {std::string(), secret_.substr(1), secret_ + "s"})
    EXPECT_EQ(Ask(hash, wrong).status, 401) << wrong;
}

TEST_F(PeerRoute, DoesNotExistWithoutASecret) {
  Start();
  EXPECT_EQ(Ask("x", "").status, 404);
}

}  // namespace
}  // namespace plumb::web
