// SPDX-License-Identifier: Apache-2.0
// A directory that says what a test wants said, by as much LDAP (RFC 4511) as a question needs.
#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "tests/support/fake_peer.hpp"
#include "web/security/tls_identity.hpp"

namespace plumb::testing {

class FakeLdap {
 public:
  /// Tags of the messages.
  enum Kind : char {
    kBind = 0x60,
    kBindAnswer = 0x61,
    kUnbind = 0x42,
    kSearch = 0x63,
    kEntry = 0x64,
    kSearchAnswer = 0x65,
    kStartTls = 0x77,
    kStartTlsAnswer = 0x78
  };
  struct Result {
    int code = 0;
    std::string text = {};
  };
  struct Answers {
    Result start_tls = {}, bind = {}, search = {};
    std::vector<std::vector<std::string>> found = {};  ///< Names of entries, for each search.
  };

  /// @param identity  By which it begins with TLS; nothing: it speaks without.
  FakeLdap(Answers answers, std::optional<web::TlsIdentity> identity)
      : answers_(std::move(answers)),
        identity_(std::move(identity)),
        peer_([this](PeerConnection& client) { Talk(client); }) {}

  [[nodiscard]] std::string url() const {
    return fmt::format("{}://localhost:{}", identity_ ? "ldaps" : "ldap", peer_.port());
  }
  /// What has been asked, without the farewell.
  [[nodiscard]] std::string kinds() const {
    const std::scoped_lock lock(mutex_);
    return kinds_;
  }
  [[nodiscard]] std::string received() const {
    const std::scoped_lock lock(mutex_);
    return received_;
  }

 private:
  static std::string Ber(char tag, const std::string& content) {
    std::string text(1, tag);
    if (content.size() >= 128) {
      text += '\x82';
      text += static_cast<char>(content.size() >> 8);
    }
    text += static_cast<char>(content.size() & 0xFF);
    return text + content;
  }
  static std::string Message(char id, Kind kind, const std::string& content) {
    return Ber(0x30, Ber(0x02, std::string(1, id)) + Ber(kind, content));
  }
  static std::string Of(const Result& result) {
    return Ber(0x0A, std::string(1, static_cast<char>(result.code))) + Ber(0x04, "") +
           Ber(0x04, result.text);
  }
  /// Without tag and length; empty once the client has gone.
  static std::string ReadMessage(PeerConnection& client) {
    const std::string head = client.ReadBytes(2);
    if (head.size() < 2) return {};
    std::size_t length = static_cast<unsigned char>(head[1]);
    if (length >= 128) {
      const std::string digits = client.ReadBytes(length - 128);
      length = 0;
      for (const char digit : digits) length = length << 8 | static_cast<unsigned char>(digit);
    }
    return client.ReadBytes(length);
  }

  void Talk(PeerConnection& client) {
    if (identity_ && !client.StartTls(*identity_)) return;
    std::size_t searches = 0;
    for (;;) {
      const std::string message = ReadMessage(client);
      // The number of a message has one byte: there are few.
      if (message.size() < 4 || message[3] == kUnbind) return;
      {
        const std::scoped_lock lock(mutex_);
        kinds_ += message[3];
        received_ += message;
      }
      const char id = message[2];
      if (message[3] == kStartTls) {
        client.Write(Message(id, kStartTlsAnswer, Of(answers_.start_tls)));
      } else if (message[3] == kBind) {
        client.Write(Message(id, kBindAnswer, Of(answers_.bind)));
      } else if (message[3] == kSearch) {
        if (searches < answers_.found.size())
          for (const std::string& name : answers_.found[searches])
            client.Write(Message(id, kEntry, Ber(0x04, name) + Ber(0x30, "")));
        ++searches;
        client.Write(Message(id, kSearchAnswer, Of(answers_.search)));
      }
    }
  }

  const Answers answers_;
  const std::optional<web::TlsIdentity> identity_;
  mutable std::mutex mutex_;
  std::string kinds_, received_;
  FakePeer peer_;  // last: its thread uses the others
};

}  // namespace plumb::testing
