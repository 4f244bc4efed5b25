// SPDX-License-Identifier: Apache-2.0
#include "daemon/loop/crash_report.hpp"

#include <elf.h>
#include <execinfo.h>
#include <link.h>
#include <signal.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace plumb {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kReports = false;
#else
constexpr bool kReports = true;
#endif

constexpr int kMaxCalls = 64;
constexpr unsigned kLongest_s = 5;
constexpr std::size_t kStackBytes = 64 << 10;
constexpr std::array kSignals{SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGABRT};

// Prepared in advance, because a crashed program must not allocate.
std::array<char, 512> headline_end{};
alignas(16) std::array<char, kStackBytes> stack_for_crashes{};
std::atomic_flag is_reporting = ATOMIC_FLAG_INIT;

void WriteText(const char* text) {
  // A failed write cannot be reported anywhere.
  if (::write(STDERR_FILENO, text, std::strlen(text)) < 0) return;
}

const char* NameOf(int signal) {
  switch (signal) {
    case SIGSEGV:
      return "SIGSEGV";
    case SIGBUS:
      return "SIGBUS";
    case SIGILL:
      return "SIGILL";
    case SIGFPE:
      return "SIGFPE";
    default:
      return "SIGABRT";
  }
}

/// Calls only functions that are allowed in a signal handler. backtrace() is allowed once its
/// libraries are loaded, which ReportCrashes() ensures. backtrace_symbols_fd() asks the loader for
/// names, so that a crash inside the loader could deadlock: the alarm ends that.
void OnCrash(int signal) {
  if (is_reporting.test_and_set()) {  // another thread is reporting and will end the process
    ::pause();
    return;
  }
  sigset_t alarm;
  sigemptyset(&alarm);
  sigaddset(&alarm, SIGALRM);
  ::signal(SIGALRM, SIG_DFL);
  ::pthread_sigmask(SIG_UNBLOCK, &alarm, nullptr);
  ::alarm(kLongest_s);

  WriteText("crashed: ");
  WriteText(NameOf(signal));
  WriteText(headline_end.data());
  void* calls[kMaxCalls];
  const int count = ::backtrace(calls, kMaxCalls);
  ::backtrace_symbols_fd(calls, count, STDERR_FILENO);
  ::signal(signal, SIG_DFL);
  ::raise(signal);  // delivered when the handler returns; ends the process as the fault would have
}

/// Build id of the program itself, as hexadecimal digits.
int FindBuildId(dl_phdr_info* info, std::size_t, void* found) {
  auto* text = static_cast<std::array<char, 65>*>(found);
  for (int i = 0; i < info->dlpi_phnum; ++i) {
    const ElfW(Phdr)& part = info->dlpi_phdr[i];
    if (part.p_type != PT_NOTE) continue;
    const auto* at = reinterpret_cast<const unsigned char*>(info->dlpi_addr + part.p_vaddr);
    const unsigned char* const end = at + part.p_memsz;
    while (at + sizeof(ElfW(Nhdr)) <= end) {
      ElfW(Nhdr) note;
      std::memcpy(&note, at, sizeof(note));
      const unsigned char* const name = at + sizeof(note);
      const unsigned char* const id = name + ((note.n_namesz + 3U) & ~3U);
      if (id + note.n_descsz > end) break;
      if (note.n_type == NT_GNU_BUILD_ID && note.n_namesz == 4 && note.n_descsz <= 32) {
        for (unsigned b = 0; b < note.n_descsz; ++b)
          std::snprintf(text->data() + 2 * b, 3, "%02x", id[b]);
        return 1;
      }
      at = id + ((note.n_descsz + 3U) & ~3U);
    }
  }
  return 1;  // the first object is the program; the others do not matter
}

}  // namespace

void ReportCrashes(const char* program, const char* version) {
  ::signal(SIGXFSZ, SIG_IGN);
  if (!kReports) return;
  std::array<char, 65> build_id{};
  ::dl_iterate_phdr(&FindBuildId, &build_id);
  std::snprintf(headline_end.data(), headline_end.size(), ", %s %s, build id %s; the calls:\n",
                program, version, build_id[0] != '\0' ? build_id.data() : "unknown");
  void* here[1];
  (void)::backtrace(here, 1);  // loads the libraries that it needs

  stack_t stack{};
  stack.ss_sp = stack_for_crashes.data();
  stack.ss_size = stack_for_crashes.size();
  ::sigaltstack(&stack, nullptr);
  struct sigaction action {};
  action.sa_handler = &OnCrash;
  action.sa_flags = SA_ONSTACK;
  sigfillset(&action.sa_mask);
  for (const int signal : kSignals) ::sigaction(signal, &action, nullptr);
}

}  // namespace plumb
