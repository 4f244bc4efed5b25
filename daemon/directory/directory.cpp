// SPDX-License-Identifier: Apache-2.0
#include "daemon/directory/directory.hpp"

#include <sodium.h>

#include <memory>
#include <utility>

#include "daemon/directory/ldap_directory.hpp"

namespace plumb {
namespace {

// A password that is wiped with its last owner, whether the question is asked or not.
struct Secret {
  explicit Secret(std::string from) : text(std::move(from)) {}
  ~Secret() { sodium_memzero(text.data(), text.size()); }
  Secret(const Secret&) = delete;
  Secret& operator=(const Secret&) = delete;
  std::string text;
};

}  // namespace

Directory::Directory(EventLoop& loop, DirectorySettings settings)
    : loop_(loop), settings_(std::move(settings)) {}

bool Directory::Ask(const std::string& name, std::string password,
                    std::function<void(const web::DirectoryAnswer&)> done) {
  return questions_.Post([this, name, secret = std::make_shared<const Secret>(std::move(password)),
                          done = alive_.WhileAlive(std::move(done))] {
    const web::DirectoryAnswer answer = AskLdap(settings_, name, secret->text, stop_.get_token());
    loop_.Post("answer of the directory", [answer, done] { done(answer); });
  });
}

}  // namespace plumb
