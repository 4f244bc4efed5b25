// SPDX-License-Identifier: Apache-2.0
#include "daemon/peers/peer_watch.hpp"

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/fake_peer.hpp"
#include "web/security/patient_hash.hpp"
#include "words/peers.hpp"

namespace plumb {
namespace {

using ::testing::ElementsAre;
using testing::FakePeer;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using testing::PeerConnection;

const std::string kSecret(40, 's');

/// Another unit, whose answer is the test's.
class PeerWatchTest : public ::testing::Test {
 protected:
  PeerWatchTest() { settings_.units = {fmt::format("http://{}", name())}; }

  [[nodiscard]] std::string name() const { return fmt::format("127.0.0.1:{}", server_.port()); }
  void Make(const std::string& secret = kSecret) {
    watch_ = std::make_unique<PeerWatch>(
        loop_, settings_, secret,
        [this](const Message& found) {
          found_.push_back(found);
          Look();
        },
        std::chrono::milliseconds(5));
  }
  /// What must be noted, and what the test does then.
  struct Step {
    std::vector<Message> wanted;
    std::function<void()> then = [] {};
  };
  /// Runs the loop, which runs only once, until all of it has come in this order.
  void Run(std::vector<Step> steps) {
    steps_ = std::move(steps);
    auto patience = loop_.MakeTimer("patience", [this] { loop_.Quit(1); });
    patience.ArmAfter(std::chrono::seconds(60));
    EXPECT_EQ(loop_.Run(), 0) << steps_.size() << " steps are left";
  }
  void Look() {
    if (steps_.empty() || watch_->notes() != steps_.front().wanted) return;
    const auto then = steps_.front().then;
    steps_.erase(steps_.begin());
    loop_.Post("then", then);
    if (steps_.empty()) loop_.Post("end", [this] { loop_.Quit(0); });
  }
  void Answer(const std::string& answer) {
    const std::lock_guard lock(mutex_);
    answer_ = answer;
  }
  static std::string Json(const std::string& body) {
    return fmt::format("HTTP/1.1 200 OK\r\nContent-Length: {}\r\n\r\n{}", body.size(), body);
  }
  [[nodiscard]] std::string head() {
    const std::lock_guard lock(mutex_);
    return head_;
  }

  std::mutex mutex_;
  std::string head_, answer_ = Json("{\"open\": true}");
  FakePeer server_{[this](PeerConnection& client) {
    const std::string head = client.ReadTo("\r\n\r\n");
    const std::lock_guard lock(mutex_);
    head_ = head;
    client.Write(answer_);
  }};
  PeersSettings settings_;
  EventLoop loop_;
  std::vector<Message> found_;
  std::vector<Step> steps_;
  std::unique_ptr<PeerWatch> watch_;
};

TEST_F(PeerWatchTest, AsksByTheHashOnlyAndSaysWhereThePatientIsOpen) {
  Make();
  watch_->SetOpen("7", "Anna-1");
  const Message is_open = say::peers::OpenElsewhere(name());
  Run({{{is_open}, [&] { Answer(Json("{\"open\": false}")); }},
       {{}, [&] { Answer(Json("{\"open\": true}")); }},
       {{is_open}, [&] { watch_->SetOpen("", ""); }},
       {{}}});
  EXPECT_THAT(found_, ElementsAre(is_open, Message(), is_open, Message()));
  EXPECT_THAT(head(), HasSubstr("Authorization: Bearer " + kSecret));
  EXPECT_THAT(head(), HasSubstr("GET /peers/open?patient=" + web::PatientHash("ANNA1", kSecret)));
  EXPECT_THAT(head(), Not(HasSubstr("Anna")));
}

TEST_F(PeerWatchTest, AnAnswerThatIsMissingInBetweenMakesNoNews) {
  Make();
  watch_->SetOpen("7", "Anna-1");
  const Message is_open = say::peers::OpenElsewhere(name());
  Run({{{is_open}, [&] { Answer("no HTTP"); }},
       {{say::peers::NotKnown(name())}, [&] { Answer(Json("{\"open\": true}")); }},
       {{is_open}}});
  EXPECT_THAT(found_, ElementsAre(is_open, Message(), Message()));
}

TEST_F(PeerWatchTest, WhateverElseIsAnsweredIsNotKnown) {
  Make();
  const Message not_known = say::peers::NotKnown(name());
  std::vector<Step> steps;
  for (const std::string& answer :
       {std::string("HTTP/1.1 401 No\r\nContent-Length: 0\r\n\r\n"), Json("{\"open\": 1}"),
        Json("[]"), Json("no"), Json("{\"open\": true, \"x\": \"" + std::string(300, 'x') + "\"}"),
        std::string("HTTP/1.1 302 No\r\nLocation: /metrics\r\nContent-Length: 0\r\n\r\n"),
        std::string()}) {
    steps.push_back({{not_known}, [&, answer] {
                       Answer(answer);
                       watch_->SetOpen("7", "P");
                     }});
    steps.push_back({{}});
  }
  steps.push_back({{not_known}});
  Answer("no HTTP");
  watch_->SetOpen("7", "P");
  Run(std::move(steps));
  for (const Message& found : found_) EXPECT_TRUE(found.empty()) << found.English();
}

TEST_F(PeerWatchTest, NobodyIsAskedWithoutAPatientOrASecret) {
  Make("");
  EXPECT_FALSE(watch_->IsSetUp());
  watch_->SetOpen("7", "P");
  EXPECT_THAT(watch_->notes(), IsEmpty());
  Make();
  EXPECT_TRUE(watch_->IsSetUp());
  // The first question is the one for the patient that was opened.
  watch_->SetOpen("8", "Q");
  Run({{{say::peers::OpenElsewhere(name())}}});
  EXPECT_THAT(head(), HasSubstr(web::PatientHash("q", kSecret)));
}

}  // namespace
}  // namespace plumb
