// SPDX-License-Identifier: Apache-2.0
#include "drivers/dicom/lock_down.hpp"

#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <vector>

#include "algo/base/errors.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

#if defined(__x86_64__)
constexpr unsigned kArchitecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr unsigned kArchitecture = AUDIT_ARCH_AARCH64;
#endif

// The thread that watches the parent may begin only after the filter holds: without rseq glibc ends
// the process then (SIGABRT), as two readers of 900 did on a busy computer.
constexpr auto kAllowed = std::to_array<unsigned>({
    SYS_read,          SYS_write,
    SYS_close,         SYS_fstat,
    SYS_lseek,         SYS_mmap,
    SYS_munmap,        SYS_mremap,
    SYS_mprotect,      SYS_brk,
    SYS_madvise,       SYS_futex,
    SYS_exit,          SYS_exit_group,
    SYS_rt_sigreturn,  SYS_rt_sigprocmask,
    SYS_ppoll,         SYS_getpid,
    SYS_gettid,        SYS_tgkill,
    SYS_clock_gettime, SYS_getrandom,
    SYS_sched_yield,   SYS_restart_syscall,
    SYS_rseq,          SYS_set_robust_list,
#ifdef SYS_poll
    SYS_poll,
#endif
});

constexpr auto kTraffic = std::to_array<unsigned>({
    SYS_sendto,
    SYS_recvfrom,
    SYS_sendmsg,
    SYS_recvmsg,
    SYS_shutdown,
    SYS_setsockopt,
    SYS_getsockopt,
    SYS_pselect6,
    SYS_getpeername,
    SYS_getsockname,
    SYS_fcntl,
    SYS_uname,
#ifdef SYS_select
    SYS_select,
#endif
});
constexpr auto kConnecting = std::to_array<unsigned>({SYS_socket, SYS_connect});
constexpr auto kStoring = std::to_array<unsigned>({
    SYS_openat,
    SYS_newfstatat,
    SYS_renameat2,
    SYS_unlinkat,
    SYS_fsync,
    SYS_getdents64,
    SYS_umask,
    SYS_faccessat,
    SYS_statx,
    SYS_writev,
    SYS_ftruncate,
#ifdef SYS_rename
    SYS_open,
    SYS_stat,
    SYS_lstat,
    SYS_access,
    SYS_rename,
    SYS_unlink,
#else
    SYS_renameat,
#endif
});

sock_filter Load(std::size_t offset) {
  return BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<unsigned>(offset));
}

sock_filter Return(unsigned what) { return BPF_STMT(BPF_RET | BPF_K, what); }

/// Skips the next instruction unless the loaded value is this one.
sock_filter UnlessSkip(unsigned value) { return BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 0, 1); }

}  // namespace

void LockDown([[maybe_unused]] Allowed allowed) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  // The sanitizers' own work needs more.
#else
  std::vector<sock_filter> filter = {
      Load(offsetof(seccomp_data, arch)), BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, kArchitecture, 1, 0),
      Return(SECCOMP_RET_KILL_PROCESS), Load(offsetof(seccomp_data, nr))};
  const auto allow = [&](const auto& calls) {
    for (const unsigned call : calls) {
      filter.push_back(UnlessSkip(call));
      filter.push_back(Return(SECCOMP_RET_ALLOW));
    }
  };
  allow(kAllowed);
  if (allowed != Allowed::kComputing) allow(kTraffic);
  if (allowed == Allowed::kNetwork) allow(kConnecting);
  if (allowed == Allowed::kStore) allow(kStoring);
  filter.push_back(Return(SECCOMP_RET_ERRNO | EPERM));
  const sock_fprog program{static_cast<unsigned short>(filter.size()), filter.data()};
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 ||
      ::syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_TSYNC, &program) != 0)
    throw IoError(say::dicom::NoSandbox(std::strerror(errno)));
#endif
}

}  // namespace plumb
