#include "process.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

extern char** environ;

namespace abbe::test {

Process::Process(std::vector<std::string> command, OnLine on_line) : on_line_(std::move(on_line)) {
  std::vector<char*> argv;
  for (std::string& word : command) argv.push_back(word.data());
  argv.push_back(nullptr);
  int out[2];
  EXPECT_EQ(::pipe2(out, O_CLOEXEC), 0);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, out[1], STDOUT_FILENO);
  EXPECT_EQ(::posix_spawn(&pid_, argv[0], &actions, nullptr, argv.data(), environ), 0) << argv[0];
  ::posix_spawn_file_actions_destroy(&actions);
  ::close(out[1]);
  reader_ = std::thread([this, fd = out[0]] { read(fd); });
}

Process::~Process() {
  if (pid_ != 0) {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  reader_.join();
}

void Process::signal(int number) const {
  ::kill(pid_, number);
}

int Process::wait_for_end(std::chrono::seconds at_most) {
  {
    std::unique_lock lock(mutex_);
    if (!changed_.wait_for(lock, at_most, [&] { return ended_; })) ::kill(pid_, SIGKILL);
  }
  int status = 0;
  ::waitpid(pid_, &status, 0);
  pid_ = 0;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

std::optional<Line> Process::wait_for(const std::string& prefix, Clock::time_point from,
                                      std::chrono::seconds at_most) {
  std::unique_lock lock(mutex_);
  std::optional<Line> found;
  const auto look = [&] {
    const auto it = std::find_if(lines_.begin(), lines_.end(), [&](const Line& line) {
      return line.came >= from && line.text.starts_with(prefix);
    });
    if (it != lines_.end()) found = *it;
    return found || ended_;
  };
  changed_.wait_for(lock, at_most, look);
  return found;
}

std::vector<Line> Process::lines() {
  const std::lock_guard lock(mutex_);
  return lines_;
}

std::string Process::transcript() {
  std::string text;
  for (const Line& line : lines()) text += line.text.substr(0, 200) + "\n";
  return text;
}

/// Ends when the program and everybody who inherited its output has closed it.
void Process::read(int fd) {
  std::string rest;
  char chunk[4096];

  for (ssize_t n = 0; (n = ::read(fd, chunk, sizeof(chunk))) > 0;) {
    const auto now = Clock::now();
    rest.append(chunk, static_cast<std::size_t>(n));
    const std::lock_guard lock(mutex_);
    for (std::size_t end = 0; (end = rest.find('\n')) != std::string::npos;
         rest.erase(0, end + 1)) {
      Line line{rest.substr(0, end), now};
      if (on_line_) {
        on_line_(line);
      } else {
        lines_.push_back(std::move(line));
      }
    }
    changed_.notify_all();
  }
  ::close(fd);
  const std::lock_guard lock(mutex_);
  ended_ = true;
  changed_.notify_all();
}

}  // namespace abbe::test
