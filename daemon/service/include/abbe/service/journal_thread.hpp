#pragma once
/// An ordinary thread that reads the state of the daemon four times a second and writes changes to
/// the journal. A slow journal delays only this thread; the hub only answers a short request for
/// its state.

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
  /// `look` returns the present state and runs on the new thread.
  JournalThread(std::string machine, std::unique_ptr<JournalSink> sink,
                std::function<Observed()> look,
                std::chrono::milliseconds period = std::chrono::milliseconds{250});
  ~JournalThread();  ///< reads the state a last time and writes the changes
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
  bool stopping_ = false;  // guarded by mutex_
  std::thread thread_;
};

}  // namespace abbe::daemon
