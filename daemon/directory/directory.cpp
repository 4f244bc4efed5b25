// SPDX-License-Identifier: Apache-2.0
#include "daemon/directory/directory.hpp"

#include <sodium.h>

#include <utility>

#include "daemon/directory/ldap_directory.hpp"

namespace plumb {

Directory::Directory(EventLoop& loop, DirectorySettings settings)
    : loop_(loop), settings_(std::move(settings)) {}

bool Directory::Ask(const std::string& name, std::string password,
                    std::function<void(const web::DirectoryAnswer&)> done) {
  return questions_.Post([this, name, password = std::move(password),
                          done = alive_.WhileAlive(std::move(done))]() mutable {
    const web::DirectoryAnswer answer = AskLdap(settings_, name, password, stop_.get_token());
    sodium_memzero(password.data(), password.size());
    loop_.Post("answer of the directory", [answer, done] { done(answer); });
  });
}

}  // namespace plumb
