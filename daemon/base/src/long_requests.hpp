#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <list>
#include <mutex>
#include <string>
#include <thread>

#include "abbe/base/control_protocol.hpp"

namespace abbe::daemon {

/// Answers long requests of the control socket on a thread of its own, one after the other: a path
/// of 10^5 vertices takes a part of a second, for which no other client would get an answer. At
/// most kMostWaiting wait; the request of a client that has left is not carried out any more. The
/// functions are for one thread.
class LongRequests {
 public:
  using Answer = std::function<std::string(const std::string& line, const ControlPeer& peer)>;
  struct Job {
    std::uint64_t client = 0;
    std::string line;  ///< the request, then its answer
    ControlPeer peer;
  };

  static constexpr std::size_t kMostWaiting = 4;  ///< of up to 4 MB each

  /// `answer` runs on the thread of the object; afterwards `done_fd`, an eventfd, is signalled. It
  /// must not throw.
  LongRequests(Answer answer, int done_fd);
  LongRequests(const LongRequests&) = delete;
  LongRequests& operator=(const LongRequests&) = delete;
  ~LongRequests();  ///< waits for the request that is being answered; the others are discarded

  /// False if too many requests wait.
  [[nodiscard]] bool take(std::uint64_t client, std::string line, ControlPeer peer);
  /// The client has left: its request is not carried out, unless it is being answered.
  void forget(std::uint64_t client);
  [[nodiscard]] std::list<Job> answered();

 private:
  void run();

  Answer answer_;
  int done_fd_;
  std::mutex mutex_;  // of the members below
  std::condition_variable changed_;
  // Lists: a request moves from one to the other without memory, so no answer can be lost.
  std::list<Job> waiting_;
  std::list<Job> answered_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace abbe::daemon
