#pragma once
/// The rest of the computer, busy without end at ordinary priority.

#include <atomic>
#include <thread>
#include <vector>

namespace abbe::tests {

class BusyWorld {
 public:
  explicit BusyWorld(bool busy) {
    for (int i = 0; busy && i < 2; ++i) {
      threads_.emplace_back([this] {
        for (volatile unsigned n = 0; !stop_.load(std::memory_order_relaxed);) n = n + 1;
      });
    }
  }
  ~BusyWorld() {
    stop_ = true;
    for (auto& thread : threads_) thread.join();
  }
  BusyWorld(const BusyWorld&) = delete;
  BusyWorld& operator=(const BusyWorld&) = delete;

 private:
  std::atomic<bool> stop_{false};
  std::vector<std::thread> threads_;
};

}  // namespace abbe::tests
