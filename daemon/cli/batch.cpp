// SPDX-License-Identifier: Apache-2.0
#include "daemon/cli/batch.hpp"

#include <algorithm>
#include <ctime>
#include <new>
#include <utility>

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/cli/shared_outputs.hpp"
#include "daemon/cli/work_digest.hpp"
#include "words/cli.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kMaxThreads = 1024;

/// Of this process, all threads together.
double CpuSeconds() {
  timespec now{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

struct BatchOutcome {
  fs::path output;  ///< Empty if there is none.
  BatchAnswer answer;
  Message error;
  bool is_reused = false;
};

/// One run over a list.
class Batch {
 public:
  Batch(const fs::path& list, const fs::path& folder, const BatchWork& work,
        const CommandContext& context)
      : items_(ReadBatchList(list, work.inputs.size())),
        rows_(items_.size()),
        folder_(folder),
        work_(work),
        context_(context) {
    EnsureFolder(folder_);
  }

  int Run() {
    RemoveUnfinished(folder_);
    std::vector<std::size_t> of_others;
    for (std::size_t i = 0; i < items_.size(); ++i)
      if (!Do(i)) of_others.push_back(i);
    while (!of_others.empty()) {
      std::erase_if(of_others, [&](std::size_t i) { return Do(i); });
      if (!of_others.empty()) WaitForOthers(context_.stop);
    }
    RemoveUnfinished(folder_);
    WriteTableOnce();
    return worst_;
  }

 private:
  /// False if another process is doing the item.
  bool Do(std::size_t i) {
    CheckStop(context_.stop);
    const double start_s = CpuSeconds();
    BatchOutcome outcome;
    const auto fail = [&](const Message& error, ExitCode code) {
      outcome.error = error;
      outcome.answer.exit_code = code;
    };
    try {
      const fs::path output =
          folder_ /
          (work_.name ? work_.name(items_[i]) : WorkName(work_.method, items_[i], context_.stop));
      if (!work_.is_finished(output)) {
        const OutputLock lock(folder_, output.filename().string());
        if (!lock.IsHeld()) return false;
        // Another process may have finished it before the lock was free.
        outcome.is_reused = work_.is_finished(output);
        if (!outcome.is_reused) work_.make(items_[i], output, NameOf(i));
      } else {
        outcome.is_reused = true;
      }
      outcome.answer = work_.read(output);
      outcome.output = output;
    } catch (const Interrupted&) {
      throw;
    } catch (const DataError& error) {
      fail(error.message(), kBadInput);
    } catch (const DeviceError& error) {
      fail(error.message(), kDeviceFailed);
    } catch (const IoError& error) {
      fail(error.message(), kInternalError);
    } catch (const std::bad_alloc&) {
      fail(say::cli::OutOfMemory(), kInternalError);
    } catch (const std::exception& error) {
      fail(say::cli::InternalError(MessageOf(error)), kInternalError);
    }
    Report(i, outcome, CpuSeconds() - start_s);
    return true;
  }

  std::string NameOf(std::size_t i) const {
    return context_.Said(say::cli::ItemOf(static_cast<std::int64_t>(i + 1),
                                          static_cast<std::int64_t>(items_.size())));
  }

  void Report(std::size_t i, const BatchOutcome& outcome, double cpu_s) {
    const BatchAnswer& answer = outcome.answer;
    Json line = Json::object();
    for (std::size_t k = 0; k < items_[i].size(); ++k)
      line[work_.inputs[k].name] = items_[i][k].string();
    line["output"] = outcome.output.empty() ? Json() : Json(outcome.output.string());
    line["exit_code"] = static_cast<int>(answer.exit_code);
    if (outcome.error.empty()) {
      line["verdict"] = answer.verdict;
    } else {
      line["error"] = outcome.error.English();
      line["error_message"] = MessageJson(outcome.error);
    }
    line["reused"] = outcome.is_reused;
    line["cpu_s"] = cpu_s;
    KeepRow(i, outcome);
    if (Severity(answer.exit_code) > Severity(worst_)) worst_ = answer.exit_code;
    PrintOut(line.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n");
  }

  void KeepRow(std::size_t i, const BatchOutcome& outcome) {
    TableRow& row = rows_[i];
    for (const fs::path& input : items_[i]) row.push_back(input.string());
    row.push_back(outcome.output.filename().string());
    row.push_back(fmt::to_string(static_cast<int>(outcome.answer.exit_code)));
    row.push_back(outcome.answer.verdict);
    row.push_back(outcome.error.empty() ? std::string() : outcome.error.English());
    for (const std::string& cell : outcome.answer.cells) row.push_back(cell);
    row.resize(work_.inputs.size() + 4 + work_.columns.size());
  }

  static int Severity(ExitCode code) {
    constexpr std::array kRising = {kDone, kNoAnswer, kBadInput, kDeviceFailed, kInternalError};
    return static_cast<int>(std::find(kRising.begin(), kRising.end(), code) - kRising.begin());
  }

  /// Two processes with one list write the same table, one after the other.
  void WriteTableOnce() {
    std::vector<TableColumn> columns = work_.inputs;
    columns.push_back({"output", "string", "Folder of the output, beside this table"});
    columns.push_back({"exit_code", "integer",
                       "0 done, 1 internal or I/O error, 3 bad input, "
                       "4 no answer"});
    columns.push_back({"verdict", "string", "Empty if there is no output"});
    columns.push_back({"error", "string", "Why there is no output"});
    columns.insert(columns.end(), work_.columns.begin(), work_.columns.end());
    for (;;) {
      const OutputLock table(folder_, work_.table),
          metadata(folder_, work_.table + "-metadata.json");
      if (table.IsHeld() && metadata.IsHeld()) {
        WriteTable(columns, rows_, folder_ / work_.table);
        return;
      }
      WaitForOthers(context_.stop);
    }
  }

  const std::vector<BatchInputs> items_;
  std::vector<TableRow> rows_;
  const fs::path folder_;
  const BatchWork& work_;
  const CommandContext& context_;
  ExitCode worst_ = kDone;
};

}  // namespace

int RunBatch(const fs::path& list, const fs::path& folder, const BatchWork& work,
             const CommandContext& context) {
  return Batch(list, folder, work, context).Run();
}

void ThreadLimit::AddTo(CLI::App& app) {
  app.add_option("--threads", threads_,
                 "Most threads to compute with; results do not depend on it. Default: one for each "
                 "processor")
      ->check(CLI::Range(1, kMaxThreads))
      ->type_name("N");
}

int ThreadLimit::Run(const std::function<int()>& command) const {
  if (!threads_) return command();
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(*threads_));
  cv::setNumThreads(*threads_);
  return command();
}

}  // namespace plumb
