// SPDX-License-Identifier: Apache-2.0
// Options of commands that write or read encrypted backups and exports.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "daemon/archive/summed_folder.hpp"
#include "daemon/files/age_recipients.hpp"

namespace plumb {

struct RecipientOptions {
  std::vector<std::string> keys;
  std::optional<std::filesystem::path> file;

  void AddTo(CLI::App& app) {
    app.add_option("--recipient", keys,
                   "Encrypt for this public key of age (age1...), as age-keygen shows it; may be "
                   "given again for more")
        ->type_name("KEY");
    app.add_option("--recipients-file", file,
                   "Encrypt for the public keys in this file, one a line")
        ->type_name("FILE");
  }

  /// @throws DataError if one is malformed; IoError
  [[nodiscard]] AgeRecipients Read() const {
    std::vector<std::string> all = keys;
    if (file) {
      const AgeRecipients more = AgeRecipients::FromFile(*file);
      all.insert(all.end(), more.keys().begin(), more.keys().end());
    }
    return AgeRecipients(all);
  }
};

struct IdentityOptions {
  std::optional<std::filesystem::path> identity_file, key_file;

  void AddTo(CLI::App& app) {
    app.add_option("--identity", identity_file,
                   "File with the identity (private key) of one of its recipients, as age-keygen "
                   "writes it")
        ->type_name("FILE");
    app.add_option("--key-file", key_file,
                   "File with the key of one that plumb 0.2.0 has encrypted")
        ->type_name("FILE");
  }

  /// Reads the files once. @throws DataError; IoError
  [[nodiscard]] BackupKeys Read() {
    if (identity_file) identity_ = std::make_shared<AgeIdentity>(*identity_file);
    if (key_file) secret_ = std::make_shared<BackupSecret>(*key_file);
    return {.identity = identity_.get(), .secret = secret_.get()};
  }

 private:
  std::shared_ptr<AgeIdentity> identity_;
  std::shared_ptr<BackupSecret> secret_;
};

}  // namespace plumb
