// SPDX-License-Identifier: Apache-2.0
// Many items of one command, each with an output that is named by what it is made of. A run keeps
// no state of its own: what is finished is seen in the folder, so that any run goes on where
// another ended, and several may work on one list at once.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "daemon/cli/batch_list.hpp"
#include "daemon/cli/batch_table.hpp"
#include "daemon/cli/commands.hpp"

namespace CLI {
class App;
}

namespace plumb {

/// What an output says.
struct BatchAnswer {
  ExitCode exit_code = kDone;
  std::string verdict;
  TableRow cells;  ///< One for each of BatchWork::columns.
};

/// How a command does one item. Errors of an item are exceptions, as of the command itself.
struct BatchWork {
  std::string method;                ///< What its options decide; see MethodText().
  std::vector<TableColumn> inputs;   ///< One for each path of an item.
  std::vector<TableColumn> columns;  ///< What the table says of the output.
  std::string table;                 ///< Name of the table's file.
  /// If set, the name of an item's output, where not all of the files of its inputs decide it.
  std::function<std::string(const BatchInputs&)> name = {};
  std::function<bool(const std::filesystem::path& output)> is_finished;
  /// @param name  Of the item, for its progress.
  std::function<void(const BatchInputs&, const std::filesystem::path& output,
                     const std::string& name)>
      make;
  std::function<BatchAnswer(const std::filesystem::path& output)> read;
};

/// Does each item unless its output is there, prints a line of JSON for each as it ends, and writes
/// the table in the order of the list. Items that another process is doing come last.
/// @return the code of the worst item: 1 before 5, 3 and 4.
/// @throws IoError if stdout, the table or the locks cannot be written; Interrupted
[[nodiscard]] int RunBatch(const std::filesystem::path& list, const std::filesystem::path& folder,
                           const BatchWork& work, const CommandContext& context);

/// --threads, for commands that are run many at a time.
class ThreadLimit {
 public:
  void AddTo(CLI::App& app);
  /// Runs something with no more threads than asked for.
  int Run(const std::function<int()>& command) const;

 private:
  std::optional<int> threads_;
};

}  // namespace plumb
