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

/// Answers long requests of the control socket on a separate thread, one after the other. A path of
/// 10^5 vertices takes a fraction of a second, in which no other client would get an answer. At
/// most kMostWaiting requests wait. The request of a client that has disconnected is not carried
/// out. The functions are for one thread.
class LongRequests {
 public:
  using Answer = std::function<std::string(const std::string& line, const ControlPeer& peer)>;
  struct Job {
    std::uint64_t client = 0;
    std::string line;  ///< the request, then its answer
    ControlPeer peer;
  };

  static constexpr std::size_t kMostWaiting = 4;  ///< requests of up to 4 MB each

  /// `answer` runs on the thread of the object; afterwards `done_fd`, an eventfd, is signalled. It
  /// must not throw.
  LongRequests(Answer answer, int done_fd);
  LongRequests(const LongRequests&) = delete;
  LongRequests& operator=(const LongRequests&) = delete;
  ~LongRequests();  ///< waits for the request that is being answered; the others are discarded

  /// False if too many requests wait.
  [[nodiscard]] bool take(std::uint64_t client, std::string line, ControlPeer peer);
  /// The client has disconnected. Its request is not carried out, unless it is being answered
  /// already.
  void forget(std::uint64_t client);
  [[nodiscard]] std::list<Job> answered();

 private:
  void run();

  Answer answer_;
  int done_fd_;
  std::mutex mutex_;  // protects the members below
  std::condition_variable changed_;
  // Lists are used because a request moves from one to the other without allocation, so that no
  // answer can be lost.
  std::list<Job> waiting_;
  std::list<Job> answered_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace abbe::daemon
