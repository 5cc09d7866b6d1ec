/* Counts the instructions between two lines that a program writes to its standard error: a plugin for qemu-user 7.2.
 *
 *     cc -shared -fPIC -O2 -o stages.so stages.c
 *     qemu-aarch64 -B 0 -d plugin -D stages.txt -plugin stages.so program      (-B 0: addresses are those of the host)
 *
 * One line for each of theirs, and one at the end: "count simulator text". `count` are the instructions until then without the
 * simulator's, which are `simulator`: functions of the crate sim by their symbols. Threads may lose a few counts to each other.
 *
 * Debian ships no qemu-plugin.h; declared below is what is used of it, in version 1 of the interface.
 */
#include <inttypes.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))

typedef uint64_t plugin_id;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
enum { QEMU_PLUGIN_INLINE_ADD_U64 };

typedef void syscall_seen(plugin_id, unsigned, int64_t, uint64_t, uint64_t, uint64_t, uint64_t, uint64_t, uint64_t, uint64_t, uint64_t);
void qemu_plugin_register_vcpu_syscall_cb(plugin_id, syscall_seen *);
void qemu_plugin_register_vcpu_tb_trans_cb(plugin_id, void (*)(plugin_id, struct qemu_plugin_tb *));
void qemu_plugin_register_atexit_cb(plugin_id, void (*)(plugin_id, void *), void *);
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *);
struct qemu_plugin_insn *qemu_plugin_tb_get_insn(const struct qemu_plugin_tb *, size_t);
const char *qemu_plugin_insn_symbol(const struct qemu_plugin_insn *);
void qemu_plugin_register_vcpu_insn_exec_inline(struct qemu_plugin_insn *, int, void *, uint64_t);
void qemu_plugin_outs(const char *);

EXPORT int qemu_plugin_version = 1;

/* Linux on aarch64. */
enum { WRITE = 64, STANDARD_ERROR = 2 };

static uint64_t others, simulator;

static void tell(const char *text, size_t length) {
    char line[400];
    int at = snprintf(line, sizeof line, "%" PRIu64 " %" PRIu64 " ", others, simulator);
    for (size_t i = 0; i < length && at < (int)sizeof line - 2; i++)
        line[at++] = text[i] < ' ' ? ' ' : text[i];
    line[at] = '\n', line[at + 1] = 0;
    qemu_plugin_outs(line);
}

static void called(plugin_id id, unsigned cpu, int64_t number, uint64_t file, uint64_t text, uint64_t length, uint64_t d, uint64_t e, uint64_t f,
                   uint64_t g, uint64_t h) {
    (void)id, (void)cpu, (void)d, (void)e, (void)f, (void)g, (void)h;
    if (number == WRITE && file == STANDARD_ERROR)
        tell((const char *)text, length);
}

static void translated(plugin_id id, struct qemu_plugin_tb *block) {
    (void)id;
    for (size_t i = 0; i < qemu_plugin_tb_n_insns(block); i++) {
        struct qemu_plugin_insn *instruction = qemu_plugin_tb_get_insn(block, i);
        const char *symbol = qemu_plugin_insn_symbol(instruction);
        /* As names are mangled: a path begins with the length of the crate's name, or stands in a generic argument. */
        int simulated = symbol && (strstr(symbol, "N3sim") || strstr(symbol, "$sim.."));
        uint64_t *count = simulated ? &simulator : &others;
        qemu_plugin_register_vcpu_insn_exec_inline(instruction, QEMU_PLUGIN_INLINE_ADD_U64, count, 1);
    }
}

static void finished(plugin_id id, void *nothing) {
    (void)id, (void)nothing;
    tell("end", 3);
}

EXPORT int qemu_plugin_install(plugin_id id, const void *machine, int argc, char **argv) {
    (void)machine, (void)argc, (void)argv;
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    qemu_plugin_register_vcpu_syscall_cb(id, called);
    qemu_plugin_register_atexit_cb(id, finished, NULL);
    return 0;
}
