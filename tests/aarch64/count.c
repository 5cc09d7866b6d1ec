/* Counts the instructions that a program executes, by symbol: a plugin for qemu-user 7.2.
 *
 *     cc -shared -fPIC -O2 -o count.so count.c
 *     qemu-aarch64 -d plugin -D counts.txt -plugin count.so program      (-d also makes qemu read the symbols)
 *
 * One line per symbol that was executed, "count symbol"; "-" stands for code without one (the C library). Emulation
 * executes what the program says: the same number on every run, for any machine that qemu emulates.
 *
 * Debian ships no qemu-plugin.h; declared below is what is used of it, in version 1 of the interface.
 */
#include <inttypes.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#define EXPORT __attribute__((visibility("default")))

typedef uint64_t plugin_id;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
enum { QEMU_PLUGIN_INLINE_ADD_U64 };

void qemu_plugin_register_vcpu_tb_trans_cb(plugin_id, void (*)(plugin_id, struct qemu_plugin_tb *));
void qemu_plugin_register_atexit_cb(plugin_id, void (*)(plugin_id, void *), void *);
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *);
struct qemu_plugin_insn *qemu_plugin_tb_get_insn(const struct qemu_plugin_tb *, size_t);
const char *qemu_plugin_insn_symbol(const struct qemu_plugin_insn *);
void qemu_plugin_register_vcpu_insn_exec_inline(struct qemu_plugin_insn *, int, void *, uint64_t);
void qemu_plugin_outs(const char *);

EXPORT int qemu_plugin_version = 1;

/* A power of two, far above the symbols of any of our programs. */
enum { SLOTS = 1 << 16 };

static struct slot {
    const char *symbol; /* qemu keeps one string per symbol: compared by address */
    uint64_t count;
} slots[SLOTS];

static struct slot *slot_of(const char *symbol) {
    size_t at = (uintptr_t)symbol % SLOTS;
    for (size_t tries = 0; tries < SLOTS; tries++, at = (at + 1) % SLOTS) {
        if (!slots[at].symbol)
            slots[at].symbol = symbol;
        if (slots[at].symbol == symbol)
            return &slots[at];
    }
    return NULL;
}

static void translated(plugin_id id, struct qemu_plugin_tb *block) {
    (void)id;
    for (size_t i = 0; i < qemu_plugin_tb_n_insns(block); i++) {
        struct qemu_plugin_insn *instruction = qemu_plugin_tb_get_insn(block, i);
        const char *symbol = qemu_plugin_insn_symbol(instruction);
        struct slot *slot = slot_of(symbol && *symbol ? symbol : "-");
        if (slot)
            qemu_plugin_register_vcpu_insn_exec_inline(instruction, QEMU_PLUGIN_INLINE_ADD_U64, &slot->count, 1);
    }
}

static void finished(plugin_id id, void *nothing) {
    (void)id, (void)nothing;
    char line[1024];
    for (size_t i = 0; i < SLOTS; i++) {
        if (slots[i].count) {
            snprintf(line, sizeof line, "%" PRIu64 " %.900s\n", slots[i].count, slots[i].symbol);
            qemu_plugin_outs(line);
        }
    }
}

EXPORT int qemu_plugin_install(plugin_id id, const void *machine, int argc, char **argv) {
    (void)machine, (void)argc, (void)argv;
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    qemu_plugin_register_atexit_cb(id, finished, NULL);
    return 0;
}
