#pragma once
/// A disk that reports an error of write-back: for the threads that ask for it, fdatasync() or
/// fsync() fails with EIO. On Linux such an error is reported once, and the next call succeeds: as
/// on any other thread here.

#include <gtest/gtest.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstddef>
#include <thread>

namespace abbe::daemon::test {

inline bool make_fail(unsigned call) {
  std::array<sock_filter, 4> filter{
      sock_filter BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      sock_filter BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, call, 0, 1),
      sock_filter BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EIO),
      sock_filter BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)};
  const sock_fprog program{static_cast<unsigned short>(filter.size()), filter.data()};
  return ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
}

/// Does `work` where system call number `call` fails.
template <class Work>
void while_failing(unsigned call, Work work) {
  std::thread{[&] {
    if (make_fail(call))
      work();
    else
      ADD_FAILURE() << "no seccomp filter";
  }}.join();
}

/// A disk that does not answer: system call number `call` of the thread that asks for it does not
/// return before the result is closed (then ENOSYS). -1: not permitted here.
inline int make_stall(unsigned call) {
  std::array<sock_filter, 4> filter{
      sock_filter BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      sock_filter BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, call, 0, 1),
      sock_filter BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_USER_NOTIF),
      sock_filter BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)};
  const sock_fprog program{static_cast<unsigned short>(filter.size()), filter.data()};
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return -1;
  return static_cast<int>(
      ::syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_NEW_LISTENER, &program));
}

/// A disk that is slow when asked to be: while it stalls, system call number `call` of the thread
/// in which start() runs, and of the threads that it begins, does not return.
class SlowDisk {
 public:
  explicit SlowDisk(unsigned call) : call_(call) {}
  SlowDisk(const SlowDisk&) = delete;
  SlowDisk& operator=(const SlowDisk&) = delete;
  ~SlowDisk() {
    ending_ = true;
    go_on();
    if (answering_.joinable()) answering_.join();
    if (listener_ >= 0) ::close(listener_);
  }

  /// Runs `work` in a thread whose calls are slow. False: not permitted here.
  template <class Work>
  bool start(Work work) {
    std::atomic<int> listener{kNotYet};
    std::thread working{[&] {
      listener = make_stall(call_);
      listener.notify_one();
      if (listener >= 0) work();
    }};
    listener.wait(kNotYet);
    listener_ = listener;
    if (listener_ >= 0) answering_ = std::thread{[this] { answer(); }};
    working.join();
    return listener_ >= 0;
  }

  void stall() { stalled_ = true; }
  void go_on() {
    stalled_ = false;
    stalled_.notify_all();
  }
  /// Returns when a call is held.
  void wait_until_held() { held_.wait(false); }

 private:
  static constexpr int kNotYet = -2;

  void answer() {
    constexpr int kLook_ms = 20;
    while (!ending_) {
      pollfd ready{.fd = listener_, .events = POLLIN, .revents = 0};
      if (::poll(&ready, 1, kLook_ms) <= 0) continue;
      if ((ready.revents & POLLIN) == 0) return;  // no thread with the filter is left
      seccomp_notif asked{};
      if (::ioctl(listener_, SECCOMP_IOCTL_NOTIF_RECV, &asked) != 0) continue;
      if (stalled_) {
        held_ = true;
        held_.notify_all();
        stalled_.wait(true);
      }
      seccomp_notif_resp go{
          .id = asked.id, .val = 0, .error = 0, .flags = SECCOMP_USER_NOTIF_FLAG_CONTINUE};
      (void)::ioctl(listener_, SECCOMP_IOCTL_NOTIF_SEND, &go);
    }
  }

  unsigned call_;
  int listener_ = -1;
  std::atomic<bool> stalled_{false}, held_{false}, ending_{false};
  std::thread answering_;
};

}  // namespace abbe::daemon::test
