// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/store_database.hpp"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "daemon/database/audit_chain.hpp"
#include "daemon/database/row_digests.hpp"

namespace plumb {

StoreDatabase::StoreDatabase(std::unique_ptr<Database> write, const std::filesystem::path& file,
                             Database::Access readers)
    : write_(std::move(write)), row_(file, readers), list_(file, readers) {
  for (Database* reader : {&row_, &list_}) UseRowKey(*reader, file.parent_path());
}

namespace {

/// Prefixes of the actions after which the log of writes is emptied.
constexpr std::array<std::string_view, 9> kDeciding = {"reference.", "user.",     "display.",
                                                       "room.",      "couch.",    "check.",
                                                       "settings.",  "template.", "scan."};

}  // namespace

void StoreChange::Log(const Actor& actor, const std::string& action, const std::string& subject,
                      const Message& detail) {
  AppendAuditEntry(*held_, actor, action, subject, detail);
  decides_ = decides_ || std::ranges::any_of(kDeciding, [&](std::string_view begin) {
               return action.starts_with(begin);
             });
}

void StoreChange::Commit() {
  transaction_.Commit();
  if (decides_) (void)held_->Checkpoint();  // if this fails, a later one empties the log
}

}  // namespace plumb
