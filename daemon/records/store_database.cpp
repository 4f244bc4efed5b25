#include "daemon/records/store_database.hpp"

#include <utility>

#include "daemon/records/audit_store.hpp"

namespace plumb {

StoreDatabase::StoreDatabase(std::unique_ptr<Database> write, const std::filesystem::path& file,
                             Database::Access readers)
    : write_(std::move(write)), row_(file, readers), list_(file, readers) {}

void StoreChange::Log(const Actor& actor, const std::string& action, const std::string& subject,
                      const std::string& detail) {
  AppendAuditEntry(*held_, actor, action, subject, detail);
}

}  // namespace plumb
