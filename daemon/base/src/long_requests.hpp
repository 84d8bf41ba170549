#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "abbe/base/control_protocol.hpp"

namespace abbe::daemon {

/// Answers long requests of the control socket on a thread of its own, one after the other: a path
/// of 10^5 vertices takes a part of a second, for which no other client would get an answer. The
/// functions are for one thread.
class LongRequests {
 public:
  using Answer = std::function<std::string(const std::string& line, const ControlPeer& peer)>;
  struct Answered {
    std::uint64_t client = 0;
    std::string line;
  };

  /// `answer` runs on the thread of the object; afterwards `done_fd`, an eventfd, is signalled.
  LongRequests(Answer answer, int done_fd);
  LongRequests(const LongRequests&) = delete;
  LongRequests& operator=(const LongRequests&) = delete;
  ~LongRequests();  ///< waits for the request that is being answered; the others are discarded

  void take(std::uint64_t client, std::string line, ControlPeer peer);
  [[nodiscard]] std::vector<Answered> answered();

 private:
  struct Waiting {
    std::uint64_t client = 0;
    std::string line;
    ControlPeer peer;
  };
  void run();

  Answer answer_;
  int done_fd_;
  std::mutex mutex_;  // of the members below
  std::condition_variable changed_;
  std::deque<Waiting> waiting_;
  std::vector<Answered> answered_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace abbe::daemon
