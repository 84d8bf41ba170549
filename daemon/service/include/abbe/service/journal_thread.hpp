#pragma once
/// An ordinary thread that looks at the daemon four times a second and writes what has changed into
/// the journal. Neither a slow journal nor this thread holds up the hub: it only answers what it is
/// asked.

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "abbe/service/state_observer.hpp"

namespace abbe::daemon {

class JournalThread {
 public:
  /// `look` runs on the new thread.
  JournalThread(std::string machine, std::unique_ptr<JournalSink> sink,
                std::function<Observed()> look,
                std::chrono::milliseconds period = std::chrono::milliseconds{250});
  ~JournalThread();  ///< looks once more
  JournalThread(const JournalThread&) = delete;
  JournalThread& operator=(const JournalThread&) = delete;

 private:
  void run();
  void look();

  StateObserver observer_;
  std::unique_ptr<JournalSink> sink_;
  std::function<Observed()> look_;
  std::chrono::milliseconds period_;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ = false;  // under mutex_
  std::thread thread_;
};

}  // namespace abbe::daemon
