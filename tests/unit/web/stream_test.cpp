// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>

#include "tests/unit/web/web_fixture.hpp"
#include "web/http/event_hub.hpp"

namespace plumb::test {
namespace {

using ::testing::HasSubstr;

class StreamTest : public WebTest {
 protected:
  HttpConnection OpenStream(const HttpClient& client, int receive_buffer = 0) {
    HttpConnection connection(port_);
    if (receive_buffer > 0) connection.SetReceiveBuffer(receive_buffer);
    connection.Send("GET /api/v1/events HTTP/1.1\r\nHost: localhost\r\nCookie: " + client.cookie +
                    "\r\n\r\n");
    return connection;
  }
};

TEST_F(StreamTest, BeginsWithTheStateAndFollowsIt) {
  Start();
  SetUpAccounts();
  const HttpClient client = LoggedIn("technician");
  HttpConnection stream = OpenStream(client);
  EXPECT_THAT(stream.ReadUntil("\n\n"),
              ::testing::AllOf(HasSubstr("text/event-stream"), HasSubstr("X-Accel-Buffering: no")));
  loop_->Do([&] { service_.Press({"technician", ""}, [](const Change&) {}); });
  EXPECT_FALSE(stream.ReadUntil("\"state\":\"scanning\"").empty());
  loop_->Do([&] { service_.Unplug(); });
  EXPECT_FALSE(stream.ReadUntil("\"state\":\"no_sensor\"").empty());
}

TEST_F(StreamTest, ManyChangesInAShortTimeAreSentTogether) {
  Start();
  SetUpAccounts();
  const HttpClient client = LoggedIn("technician");
  HttpConnection stream = OpenStream(client);
  stream.ReadUntil("\n\n");
  loop_->Do([&] {
    for (int i = 0; i < 1000; ++i) service_.Notify(web::EventKind::kProgress);
    service_.Notify(web::EventKind::kData);
  });
  const std::string until_data = stream.ReadUntil("event: data");
  loop_->Do([&] {
    service_.status.fault = Message::Verbatim("end of test");
    service_.Notify(web::EventKind::kStatus);
  });
  const std::string text = until_data + stream.ReadUntil("end of test");
  std::size_t count = 0;
  for (std::size_t at = 0; (at = text.find("event: status", at)) != std::string::npos; ++at)
    ++count;
  EXPECT_LE(count, 4U);
}

TEST_F(StreamTest, EndsWhenTheSessionEnds) {
  Start();
  SetUpAccounts();
  HttpClient client = LoggedIn("technician");
  HttpConnection stream = OpenStream(client);
  stream.ReadUntil("\n\n");
  EXPECT_EQ(client.Post("/api/v1/logout").status, 200);
  EXPECT_FALSE(stream.ReadUntil("logged_off").empty());
}

TEST_F(StreamTest, EndsWithinASecondHoweverTheSessionEnds) {
  Start();
  SetUpAccounts();
  HttpClient engineer = LoggedIn("engineer");
  const auto ends_within_a_second = [&](const std::string& name,
                                        const std::function<void(HttpClient&)>& end) {
    HttpClient client = LoggedIn(name);
    HttpConnection stream = OpenStream(client);
    stream.ReadUntil("event: status");
    end(client);
    const auto since = std::chrono::steady_clock::now();
    EXPECT_FALSE(stream.ReadUntil("logged_off").empty());
    EXPECT_FALSE(stream.ReadUntil("0\r\n\r\n").empty()) << "nothing comes after it";
    const double passed_s =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - since).count();
    return passed_s;
  };
  // Asked for: 1 s. The last one waits for the timer of half a second.
  EXPECT_LT(
      ends_within_a_second("technician", [](HttpClient& client) { client.Post("/api/v1/logout"); }),
      1.0);
  EXPECT_LT(ends_within_a_second("technician",
                                 [&](HttpClient&) {
                                   engineer.Put("/api/v1/users/technician",
                                                {{"role", "technician"},
                                                 {"disabled", true},
                                                 {"password", ""},
                                                 {"own_password", kPassword}});
                                 }),
            1.0);
  EXPECT_LT(ends_within_a_second("physicist", [&](HttpClient&) { skipped_s_ += 3600; }), 1.0);
}

TEST_F(StreamTest, AViewerThatNeverReadsIsDroppedAndCostsNobodyAnything) {
  Start([](web::HttpServerOptions& options) { options.event_buffer_bytes = 16 << 10; });
  SetUpAccounts();
  const HttpClient client = LoggedIn("technician");
  HttpConnection deaf = OpenStream(client, 4096);
  HttpConnection reader = OpenStream(client);
  reader.ReadUntil("\n\n");
  // Far more than the sockets' buffers hold; the kernel's send buffer may grow to megabytes.
  for (int i = 0; i < 400; ++i) {
    loop_->Do([&] {
      service_.status.fault = Message::Verbatim(std::string(8000, 'x') + std::to_string(i));
      for (int j = 0; j < 50; ++j) service_.Notify(web::EventKind::kData);
    });
    reader.ReadUntil("event: data");
  }
  const auto is_dropped = [&] {
    int count = 0;
    loop_->Do([&] {
      for (int j = 0; j < 2000; ++j) service_.Notify(web::EventKind::kResult);
      ++count;
    });
    return count;
  };
  for (int i = 0; i < 50; ++i) is_dropped();
  EXPECT_TRUE(deaf.IsClosedBySoon());
  EXPECT_EQ(HttpClient(port_).Get("/health").status, 200);
}

TEST_F(StreamTest, StreamsAreFewAndTheOldestMakesRoomForAnother) {
  Start([](web::HttpServerOptions& options) { options.max_event_streams = 2; });
  SetUpAccounts();
  const HttpClient client = LoggedIn("technician");
  HttpConnection first = OpenStream(client), second = OpenStream(client);
  first.ReadUntil("event: status");
  second.ReadUntil("event: status");
  const HttpClient other = LoggedIn("physicist");
  HttpConnection third = OpenStream(other);
  EXPECT_FALSE(third.ReadUntil("event: status").empty());
  EXPECT_FALSE(first.ReadUntil("0\r\n\r\n").empty()) << "the oldest has ended";
  loop_->Do([&] { service_.Notify(web::EventKind::kData); });
  EXPECT_FALSE(second.ReadUntil("event: data").empty());
}

TEST(EventHubTest, AFullBufferClosesTheStreamAndFreesIt) {
  web::EventHub hub({.all = 4, .of_account = 4, .of_session = 4, .buffer_bytes = 100});
  const auto stream = hub.Open(std::make_shared<web::Session>());
  bool cut = false;
  stream->cut = [&] { cut = true; };
  hub.Broadcast("status", std::string(50, 'x'));
  EXPECT_FALSE(cut);
  hub.Broadcast("status", std::string(50, 'x'));
  EXPECT_TRUE(cut);
  EXPECT_TRUE(stream->closed());
  EXPECT_EQ(stream->waiting(), 0U);
}

TEST(EventHubTest, NoAccountTakesThePlacesOfAnother) {
  web::EventHub hub({.all = 5, .of_account = 3, .of_session = 2, .buffer_bytes = 100});
  const auto session = [](const std::string& user) {
    auto made = std::make_shared<web::Session>();
    made->user = user;
    return made;
  };
  std::vector<std::shared_ptr<web::EventStream>> anna;
  for (int browser = 0; browser < 4; ++browser) anna.push_back(hub.Open(session("anna")));
  EXPECT_TRUE(anna[0]->closed()) << "the oldest of her four browsers";
  for (int i = 1; i < 4; ++i) EXPECT_FALSE(anna[static_cast<std::size_t>(i)]->closed());
  hub.Remove(anna[0]);
  const auto bert = session("bert");
  const auto first = hub.Open(bert), second = hub.Open(bert);
  ASSERT_TRUE(first && second);
  EXPECT_NE(hub.Open(bert), nullptr);
  EXPECT_TRUE(first->closed()) << "his browser's third ends its first";
  for (int i = 1; i < 4; ++i) EXPECT_FALSE(anna[static_cast<std::size_t>(i)]->closed());
  // Both together have all places.
  const auto chris = hub.Open(session("chris"));
  ASSERT_NE(chris, nullptr);
  EXPECT_TRUE(anna[1]->closed()) << "the oldest of the account with the most";
  EXPECT_FALSE(second->closed());
  const auto dora = hub.Open(session("dora"));
  ASSERT_NE(dora, nullptr);
  EXPECT_TRUE(anna[2]->closed()) << "hers is the oldest of two accounts with two each";
  EXPECT_FALSE(anna[3]->closed() || second->closed() || chris->closed() || dora->closed());
}

TEST(EventHubTest, WhatIsTakenMakesRoom) {
  web::EventHub hub({.all = 4, .of_account = 4, .of_session = 4, .buffer_bytes = 100});
  const auto stream = hub.Open(std::make_shared<web::Session>());
  for (int i = 0; i < 1000; ++i) {
    hub.Broadcast("status", std::string(40, 'x'));
    stream->Take(stream->Peek(1000).size());
  }
  EXPECT_FALSE(stream->closed());
}

}  // namespace
}  // namespace plumb::test
