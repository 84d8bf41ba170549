#include "program.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <regex>
#include <thread>

extern char** environ;

namespace abbe::test {
namespace {

constexpr std::chrono::milliseconds kPollPeriod{10};
constexpr mode_t kReadable = 0644;

std::string with(const std::filesystem::path& log, const char* extension) {
  return log.string() + extension;
}

}  // namespace

void wait_a_little() {
  std::this_thread::sleep_for(kPollPeriod);
}

std::string text_of(const std::filesystem::path& file) {
  std::ifstream in{file, std::ios::binary};
  return {std::istreambuf_iterator<char>{in}, {}};
}

std::string replaced(const std::string& text, const std::string& pattern, const std::string& by) {
  const std::regex what{pattern};
  EXPECT_TRUE(std::regex_search(text, what)) << "nothing like " << pattern << " in:\n" << text;
  return std::regex_replace(text, what, by);
}

Program::Program(std::vector<std::string> command, std::filesystem::path log)
    : log_(std::move(log)) {
  std::vector<char*> argv;
  for (std::string& word : command) argv.push_back(word.data());
  argv.push_back(nullptr);
  constexpr int kFresh = O_WRONLY | O_CREAT | O_TRUNC;
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, with(log_, ".out").c_str(), kFresh,
                                     kReadable);
  ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, with(log_, ".err").c_str(), kFresh,
                                     kReadable);
  EXPECT_EQ(::posix_spawn(&pid_, argv[0], &actions, nullptr, argv.data(), environ), 0) << argv[0];
  ::posix_spawn_file_actions_destroy(&actions);
}

Program::~Program() {
  if (!running()) return;
  signal(SIGKILL);
  ::waitpid(pid_, nullptr, 0);
}

bool Program::running() {
  if (pid_ == 0) return false;
  int status = 0;
  if (::waitpid(pid_, &status, WNOHANG) != pid_) return true;
  code_ = WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  pid_ = 0;
  return false;
}

void Program::signal(int number) const {
  if (pid_ != 0) ::kill(pid_, number);
}

int Program::wait_for_end(std::chrono::milliseconds at_most) {
  if (!eventually([this] { return !running(); }, at_most)) {
    signal(SIGKILL);
    eventually([this] { return !running(); });
  }
  return code_;
}

int Program::stop() {
  signal(SIGTERM);
  return wait_for_end();
}

std::string Program::out() const {
  return text_of(with(log_, ".out"));
}
std::string Program::err() const {
  return text_of(with(log_, ".err"));
}

}  // namespace abbe::test
