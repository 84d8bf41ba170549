#include "abbe/service/background_tasks.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <memory>
#include <stdexcept>
#include <thread>

namespace abbe::daemon {
namespace {

TEST(BackgroundTasks, AnAbandonedTaskIsNotWaitedForAndIsListedAsRunning) {
  auto go_on = std::make_shared<std::promise<void>>();
  auto ended = std::make_shared<std::promise<void>>();
  auto has_ended = ended->get_future();
  {
    const auto abandoned = run_abandonable([go = go_on->get_future(), ended]() mutable {
      go.wait();
      ended->set_value();
      return 0;
    });
  }  // a future of std::async would wait here for ever

  EXPECT_TRUE(background_tasks_running());
  go_on->set_value();
  has_ended.wait();
  while (background_tasks_running()) std::this_thread::yield();
}

/// 7 if all of it is done in a process that may have no thread beside the dispatcher.
[[noreturn]] void work_without_threads() {
  prepare_background_tasks();
  const rlimit none{.rlim_cur = 1, .rlim_max = 1};  // does not hold for root
  constexpr uid_t kNobody = 65534;
  const bool limited = ::setrlimit(RLIMIT_NPROC, &none) == 0 &&
                       (::geteuid() != 0 || ::setresuid(kNobody, kNobody, kNobody) == 0);
  auto first = run_in_background([] { return 3; });
  auto second = run_in_background([] { return 4; });
  ::_exit(limited ? first.get() + second.get() : 1);
}

/// As the TasksMax of a unit refuses a thread.
TEST(BackgroundTasks, AlsoRunIfTheSystemRefusesAThread) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(work_without_threads(), testing::ExitedWithCode(7), "");
}

TEST(BackgroundTasks, AnExceptionIsRethrownWhereTheResultIsTaken) {
  auto work = run_abandonable([]() -> int { throw std::runtime_error{"no"}; });
  EXPECT_THROW((void)work.get(), std::runtime_error);
}

TEST(BackgroundTasks, CapturesAreDestroyedBeforeTheResultIsAvailable) {
  std::thread::id destroyed_on;
  std::shared_ptr<int> held{new int, [&destroyed_on](const int* p) {
                              destroyed_on = std::this_thread::get_id();
                              delete p;
                            }};
  auto work = run_in_background([held = std::move(held)] { return *held = 1; });
  EXPECT_EQ(work.get(), 1);
  EXPECT_NE(destroyed_on, std::thread::id{});
  EXPECT_NE(destroyed_on, std::this_thread::get_id());
}

}  // namespace
}  // namespace abbe::daemon
